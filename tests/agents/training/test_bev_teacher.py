"""The teacher of the BEV features marks what truly lies in each cell."""

from __future__ import annotations

import numpy as np
import pytest

from agents.driveinsight.semantics import BevClass
from agents.networks.grid import GridConfig
from agents.training.bev_teacher import bev_semantics
from di_envs.town.lanes import LightState
from di_envs.world.state import ActorKind
from di_envs.world.world import WorldView
from tests.hand_made import Scene, toy_plan, toy_town

GRID = GridConfig()  # 48 x 48 cells of 0.8 m, from 8 m behind and 19.2 m to the left
LANE_Y = -44.75  # of an eastward lane to the stop line of head 0 at x = -15


@pytest.fixture(scope="module")
def town():
    return toy_town()


@pytest.fixture
def scene(town):
    return Scene(town, toy_plan(town))


def marked(scene, class_):
    """The cells (row, column) of a class."""
    view = WorldView(
        town=scene.town, state=scene.state, plans=(scene.plan,), capacity=scene.capacity
    )
    return [tuple(cell) for cell in np.argwhere(bev_semantics(view, GRID) == class_).tolist()]


def box(rows, columns):
    return [(row, column) for row in rows for column in columns]


def test_a_car_ten_metres_ahead_fills_its_cells(scene):
    scene.put(0, -60.0, LANE_Y)
    scene.put(1, -50.0, LANE_Y)
    # It is 4 m by 2 m: 8 to 12 m ahead are the centres 8.4 to 11.6, rows (8 + 8) / 0.8 = 20 to 24;
    # 1 m to either side are -0.4 and 0.4, columns 19.2 / 0.8 = 24 and the one before.
    assert marked(scene, BevClass.VEHICLE) == box(range(20, 25), (23, 24))


def test_a_car_turned_across_lies_across(scene):
    scene.put(0, -60.0, LANE_Y)
    scene.put(1, -50.0, LANE_Y + 0.1, yaw=np.pi / 2)
    # 9 to 11 m ahead, rows 21 to 23; -1.9 to 2.1 m to the right, columns 22 (-1.2) to 26 (2.0)
    assert marked(scene, BevClass.VEHICLE) == box(range(21, 24), range(22, 27))


def test_somebody_smaller_than_a_cell_is_marked_all_the_same(scene):
    scene.put(0, -60.0, LANE_Y)
    scene.put(1, -50.0, LANE_Y + 4.05, kind=ActorKind.WALKER)
    scene.state.half_length[1] = scene.state.half_width[1] = 0.2
    # (8 + 10) / 0.8 = 22.5 and (19.2 + 4.05) / 0.8 = 29.06: no centre lies in the box
    assert marked(scene, BevClass.WALKER) == [(22, 29)]


def test_what_is_on_a_bridge_above_is_not_marked(scene):
    scene.put(0, -60.0, LANE_Y)
    scene.put(1, -50.0, LANE_Y, z=5.0)
    assert marked(scene, BevClass.VEHICLE) == []


@pytest.mark.parametrize("shown", [LightState.RED, LightState.GREEN])
def test_a_light_marks_the_cells_before_its_stop_line_whatever_it_shows(scene, shown):
    scene.put(0, -25.4, LANE_Y)
    scene.state.light[:] = shown
    # The line is 10.4 m ahead, marked for 1.6 m before it: centres 9.2 and 10.0, rows 21 and 22.
    # Two lanes of 3.5 m, ours and the one to the left: -5.25 to 1.75 m are the centres -5.2 to 1.2.
    ahead = [(row, column) for row, column in marked(scene, BevClass.STOP) if row < 30]
    assert ahead == box((21, 22), range(17, 26))


def test_road_lies_ahead_and_lines_beside_the_lanes(scene):
    scene.put(0, -44.0, LANE_Y)
    assert (20, 24) in marked(scene, BevClass.ROAD)
    columns = {column for row, column in marked(scene, BevClass.LINE) if 10 <= row < 30}
    # Two lanes of 3.5 m: their lines are 5.25 and 1.75 m to the left and 1.75 m to the right, at
    # (19.2 - 5.25) / 0.8 = 17.4, 21.8 and 26.2 columns; a line is drawn inside the road's edge.
    assert {17, 21} <= columns
    assert columns & {25, 26}
    assert not columns & {18, 19, 20, 22, 23, 24}
