"""The expert's path: one smooth line out of a route's lanes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import di_envs
from agents.expert.base_line import STEP_M
from agents.expert.config import ExpertConfig
from agents.expert.decision import start_progress
from agents.expert.legs import legs_of
from agents.expert.path import DrivePath, build_path
from agents.expert.progress import pose_at, project
from di_envs.town.loading import load_town
from di_envs.town.plan import RoutePlan
from di_envs.town.routing.road_graph import build_road_graph
from di_envs.town.routing.router import plan_route
from di_envs.town.routing.routes import read_routes
from di_envs.town.town import Town
from di_envs.world.dynamics import EgoModel

ROUTES = Path(di_envs.__file__).parent / "town" / "data" / "routes"
CONFIG = ExpertConfig()


@pytest.fixture(scope="module")
def town() -> Town:
    return load_town("town05")


@pytest.fixture(scope="module")
def plans(town: Town) -> list[RoutePlan]:
    graph = build_road_graph(town)
    routes = read_routes(ROUTES / "town05_long.xml")[-3:]
    routes += read_routes(ROUTES / "town05_short.xml")[::4]
    return [
        plan_route(town, route.positions, route_id=route.route_id, graph=graph) for route in routes
    ]


@pytest.fixture(scope="module")
def paths(town: Town, plans: list[RoutePlan]) -> list[DrivePath]:
    return [build_path(plan, town, CONFIG) for plan in plans]


def made_up_plan(lanes: list[tuple[int, float]]) -> RoutePlan:
    """A plan of which only lanes and stations matter."""
    count = len(lanes)
    return RoutePlan(
        route_id="0",
        town="none",
        keypoints=np.zeros((2, 3)),
        points=np.zeros((count, 4)),
        option=np.full(count, 4, np.int8),
        lane=np.array([lane for lane, _ in lanes], np.int32),
        lane_m=np.array([station for _, station in lanes]),
        route_m=np.arange(float(count)),
        targets=np.array([count - 1], np.int32),
    )


def test_steps_back_at_keypoints_leave_no_trace():
    within = [(5, 0.0), (5, 8.0), (5, 7.0), (5, 12.0)]
    assert [vars(leg) for leg in legs_of(made_up_plan(within))] == [
        {"lane": 5, "begin_m": 0.0, "end_m": 12.0}
    ]
    across = [(5, 0.0), (5, 20.0), (6, 0.5), (6, 1.5), (5, 19.0), (5, 20.0), (6, 0.5), (6, 9.0)]
    assert [(leg.lane, leg.end_m) for leg in legs_of(made_up_plan(across))] == [(5, 20.0), (6, 9.0)]


def test_points_are_half_a_metre_apart_but_where_the_lane_changes(paths: list[DrivePath]):
    for path in paths:
        step = np.hypot(np.diff(path.x), np.diff(path.y))
        after = np.arange(1, path.x.size) * STEP_M
        jump = np.zeros(step.size, bool)
        for station in path.change_jump_m:
            jump |= (after >= station) & (after < station + STEP_M)
        assert np.abs(step[~jump] - STEP_M).max() < 0.05
        assert jump.sum() == path.change_jump_m.size


def test_the_path_runs_on_the_routes_lanes(plans: list[RoutePlan], paths: list[DrivePath]):
    """Of all route points but those just behind a lane change, where it is still under way."""
    progress = start_progress()._replace(changes=100)  # all changes made, and long ago
    for plan, path in zip(plans, paths, strict=True):
        offsets, index = [], 0
        for x, y, _, _ in plan.points:  # looked for near the last: a path may cross itself
            station, offset, _ = project(
                path, progress, x, y, max(index - 20, 0), min(index + 40, path.x.size)
            )
            index = int(station / STEP_M)
            offsets.append(abs(offset))
        assert np.median(offsets) < 0.01
        assert np.max(offsets) < 0.35


def test_before_a_change_is_begun_the_path_keeps_to_the_old_lane(paths: list[DrivePath]):
    progress = start_progress()
    changes = 0
    for path in paths:
        for k, jump in enumerate(path.change_jump_m):
            if k > 0:
                break
            changes += 1
            before, after = pose_at(path, progress, jump - 0.5), pose_at(path, progress, jump + 0.5)
            assert np.hypot(after[0] - before[0], after[1] - before[1]) == pytest.approx(1, abs=0.2)
            assert 3.0 < abs(path.change_shift_m[k]) < 8.0
    assert changes > 3


def test_lane_changes_have_room_before_the_junction(paths: list[DrivePath]):
    for path in paths:
        assert (path.change_jump_m <= path.change_latest_m).all()
        assert (path.change_latest_m < path.change_limit_m).all()


def test_no_corner_is_tighter_than_the_wheel_allows(paths: list[DrivePath]):
    model = EgoModel()
    wheelbase = model.front_axle_m + model.rear_axle_m
    tightest = np.tan(model.steer_gain_rad) / wheelbase
    for path in paths:
        assert np.abs(path.curvature).max() < tightest


def test_speeds_keep_limits_corners_and_braking(town: Town, paths: list[DrivePath]):
    fastest = town.lanes.speed_limit_mps.max()
    for path in paths:
        speed = path.speed_mps
        assert speed.max() <= fastest + 1e-9
        assert (speed**2 * np.abs(path.curvature)).max() <= CONFIG.lateral_mps2 + 1e-6
        slowing = (speed[:-1] ** 2 - speed[1:] ** 2) / (2.0 * STEP_M)
        assert slowing.max() <= CONFIG.corner_braking_mps2 + 1e-6


def test_the_routes_stop_lines_are_on_the_path(town: Town, paths: list[DrivePath]):
    for path in paths:
        for station, signal in zip(path.line_m, path.line_signal, strict=True):
            if station < 0.0:
                continue  # just behind the start
            index = int(station / STEP_M)
            lines = np.flatnonzero(town.signals.stop_signal == signal)
            poses = town.signals.stop_pose[lines]
            away = np.hypot(poses[:, 0] - path.x[index], poses[:, 1] - path.y[index])
            assert away.min() < 1.0


def test_the_path_goes_on_behind_the_routes_end(plans: list[RoutePlan], paths: list[DrivePath]):
    for plan, path in zip(plans, paths, strict=True):
        end = int(path.end_m[0] / STEP_M)
        x, y = plan.points[-1, :2]
        assert np.hypot(path.x[end] - x, path.y[end] - y) < 0.6
        assert path.x.size * STEP_M > path.end_m[0] + 60.0


def test_a_path_is_read_only(paths: list[DrivePath]):
    with pytest.raises(ValueError, match="read-only"):
        paths[0].x[0] = 1.0
