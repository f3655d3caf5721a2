"""True rows: who is on the grid and in sight, and which signal governs the ego's lane."""

from __future__ import annotations

import numpy as np
import pytest

from agents.driveinsight.perception_losses import OTHERS
from agents.networks.grid import GridConfig
from agents.training.truth import SIGNAL_AHEAD_M, seen_truth, shown_lamps
from di_envs.sensors.camera.config import rig_of
from di_envs.town.lanes import LightState
from di_envs.world.state import ActorKind
from di_envs.world.world import WorldView
from tests.hand_made import Scene, toy_plan, toy_town

GRID = GridConfig(x_min_m=-16.0, x_max_m=60.8, y_min_m=-38.4, y_max_m=38.4, cells=96)
NARROW = rig_of("driveinsight").cameras[-1]
LANE_Y = -44.75  # of an eastward lane to the stop line of head 0 at x = -15


@pytest.fixture(scope="module")
def town():
    return toy_town()


@pytest.fixture
def scene(town):
    scene = Scene(town, toy_plan(town))
    scene.put(0, -60.0, LANE_Y)
    scene.state.light[:] = LightState.GREEN
    return scene


def view_of(scene):
    return WorldView(
        town=scene.town, state=scene.state, plans=(scene.plan,), capacity=scene.capacity
    )


def truth(scene):
    return seen_truth(view_of(scene), GRID)


def put(scene, actor, ahead, right, *, height=1.5, **other):
    """Places somebody as the ego, which looks east, sees him."""
    ego = scene.state
    scene.put(actor, ego.x[0] + ahead, ego.y[0] + right, **other)
    scene.state.height[actor] = height


def test_a_bicycle_is_told_by_place_heading_size_and_velocity_over_the_ground(scene):
    scene.state.speed[0] = 7.0  # the ego's own: not subtracted
    put(scene, 1, 20.0, -3.0, yaw=np.pi / 2, speed=4.0, kind=ActorKind.BICYCLE)
    objects, _ = truth(scene)
    # 4 m by 2 m, turned to the right: it moves to the right at 4 m/s
    expected = [20.0, -3.0, np.pi / 2, 4.0, 2.0, 0.0, 4.0, ActorKind.BICYCLE, 1.0]
    assert objects.tolist() == [pytest.approx(expected, abs=1e-5)]


def test_kinds_are_told_apart_as_eyes_can(scene):
    put(scene, 1, 10.0, -4.0, kind=ActorKind.BUS)
    put(scene, 2, 10.0, 4.0, kind=ActorKind.MOTORCYCLE)
    put(scene, 3, 20.0, 4.0, kind=ActorKind.WALKER)
    kinds = [ActorKind.CAR, ActorKind.BICYCLE, ActorKind.WALKER]
    assert truth(scene)[0][:, 7].tolist() == kinds


@pytest.mark.parametrize(
    ("ahead", "right", "there"),
    [(60.7, 0.0, True), (60.9, 0.0, False), (-15.9, 38.3, True), (-16.1, 0.0, False)],
)
def test_those_whose_middle_lies_on_the_grid_are_there(scene, ahead, right, there):
    put(scene, 1, ahead, right, height=20.0)  # taller than any house that might hide it
    assert len(truth(scene)[0]) == there


def test_lifeless_things_and_other_levels_are_left_out(scene):
    put(scene, 1, 10.0, 0.0, kind=ActorKind.PROP)
    put(scene, 2, 20.0, 0.0, kind=ActorKind.DEBRIS)
    put(scene, 3, 30.0, 0.0, z=5.0)
    assert len(truth(scene)[0]) == 0


def test_a_walker_behind_a_van_is_there_and_not_in_sight(scene):
    put(scene, 1, 10.0, 0.0, height=2.5, kind=ActorKind.VAN)
    put(scene, 2, 14.0, 0.0, height=1.7, kind=ActorKind.WALKER)
    scene.state.half_length[2] = scene.state.half_width[2] = 0.3
    assert truth(scene)[0][:, 8].tolist() == [1.0, 0.0]
    scene.state.height[1] = 1.0  # over something this low the driver looks
    assert truth(scene)[0][:, 8].tolist() == [1.0, 1.0]


@pytest.mark.parametrize(
    ("shown", "column"), [(LightState.RED, 3), (LightState.YELLOW, 4), (LightState.GREEN, 5)]
)
def test_the_light_at_the_lanes_end_governs(scene, shown, column):
    scene.put(0, -35.0, LANE_Y + 0.5)
    scene.state.light[0] = shown
    _, signals = truth(scene)
    # the line is 20 m ahead, its middle that of the lane
    expected = np.zeros(8)
    expected[[0, 1, column, 7]] = 20.0, -0.5, 1.0, 1.0
    assert signals.tolist() == [pytest.approx(expected, abs=1e-5)]


def test_a_stop_sign_says_so_and_shows_no_colour(scene):
    # the sign's lane runs towards +y at x = -1.75 and ends at y = 35
    scene.put(0, -1.75, 25.0, yaw=np.pi / 2)
    scene.state.light[:] = LightState.RED  # of other heads
    _, signals = truth(scene)
    assert signals.tolist() == [pytest.approx([10.0, 0, 0, 0, 0, 0, 1.0, 1.0], abs=1e-5)]


@pytest.mark.parametrize(("before_m", "governs"), [(-0.5, True), (0.5, False)])
def test_a_signal_governs_from_fifty_metres_on(scene, before_m, governs):
    scene.put(0, -15.0 - SIGNAL_AHEAD_M - before_m, LANE_Y)
    assert len(truth(scene)[1]) == governs


def test_nothing_governs_behind_the_line_or_off_the_lanes(scene):
    scene.put(0, -14.0, LANE_Y)  # in the junction, where three ways part
    assert len(truth(scene)[1]) == 0
    scene.put(0, -35.0, LANE_Y + 9.0)  # beside the road
    assert len(truth(scene)[1]) == 0


def test_who_drives_against_his_lane_is_governed_by_nothing(scene):
    scene.put(0, -35.0, LANE_Y, yaw=np.pi)
    assert len(truth(scene)[1]) == 0


@pytest.mark.parametrize("shown", [LightState.RED, LightState.GREEN])
def test_the_lit_lamp_of_the_lanes_light_is_where_the_camera_has_it(scene, shown):
    scene.put(0, -45.0, LANE_Y)
    scene.state.light[:] = LightState.YELLOW
    scene.state.light[0] = shown
    lamps = shown_lamps(view_of(scene), NARROW, 4)
    governing = lamps[(lamps[:, 2] >= 0.0) & (lamps[:, 2] < 4.0)]
    assert set(governing[:, 2]) == {0.0 if shown == LightState.RED else 2.0}
    assert len(governing) == 2  # beside the line, and beyond the junction
    # red hangs 0.84 m above green: so many pixels, at 32 m and at 68 m from the camera at the most
    rows = {}
    for light in (LightState.RED, LightState.GREEN):
        scene.state.light[0] = light
        rows[light] = shown_lamps(view_of(scene), NARROW, 4)[:2, 0]
    apart = 4.0 * (rows[LightState.GREEN] - rows[LightState.RED])
    assert ((NARROW.focal_px * 0.84 / 70.0 < apart) & (apart < NARROW.focal_px * 0.84 / 28.0)).all()


def test_lamps_of_a_light_that_was_passed_are_told_as_others(scene):
    scene.put(0, -14.0, LANE_Y)
    scene.state.light[:] = LightState.RED
    shown = shown_lamps(view_of(scene), NARROW, 4)[:, 2]
    assert set(shown[shown >= 0.0]) == {OTHERS}
