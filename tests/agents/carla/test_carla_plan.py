"""The route as a Leaderboard agent gets it: GPS and world alike, thinned out by its rules."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest

from agents.carla.plan import global_plan
from agents.carla.values import carla_values
from agents.navigation.local_planner import RoadOption
from di_envs.suites import load_suite
from di_envs.town.loading import load_town
from leaderboard.autoagents.autonomous_agent import AutonomousAgent
from leaderboard.utils.route_manipulation import downsample_route
from tests.carla_wheel import carla_wheel


@pytest.fixture(scope="module")
def town():
    suite = load_suite("town05_short")
    return load_town(suite.town_path, suite.signals)


@pytest.fixture(scope="module")
def plan(town):
    return load_suite("town05_short").plans(town, ["1"])[0]


class Told(AutonomousAgent):
    """Keeps what it is told."""

    def setup(self, path_to_conf_file):
        self.config = path_to_conf_file


def told(plan, *arguments):
    agent = Told(*arguments)
    agent.set_global_plan(*global_plan(plan))
    return agent


def decoded(point, origin):
    """World x, y [m] of a GPS point, by CARLA's Mercator run backwards."""
    latitude, longitude = origin
    scale = math.cos(math.radians(latitude)) * 6378137.0
    x = scale * math.radians(point["lon"] - longitude)
    at, zero = (math.log(math.tan(math.radians(45.0 + q / 2.0))) for q in (point["lat"], latitude))
    return x, -scale * (at - zero)


def test_a_gps_point_decodes_to_its_world_point(plan):
    gps, world = global_plan(plan)
    assert len(gps) == len(world) == len(plan.points)
    for (point, option), (transform, same), row in zip(gps, world, plan.points, strict=True):
        x, y = decoded(point, plan.geo_origin)
        assert math.hypot(x - row[0], y - row[1]) < 1e-5
        assert math.hypot(x - transform.location.x, y - transform.location.y) < 0.01
        assert point["z"] == pytest.approx(row[2])
        assert option is same
        assert math.cos(math.radians(transform.rotation.yaw) - row[3]) > 1.0 - 1e-9


def test_leaderboard_one_keeps_the_plans_target_points(plan):
    agent = told(plan, "config.yaml")
    assert agent.config == "config.yaml"
    assert len(agent._global_plan) == len(plan.targets)
    kept = [(t.location.x, t.location.y) for t, _ in agent._global_plan_world_coord]
    np.testing.assert_allclose(kept, plan.points[plan.targets, :2], atol=1e-3)
    options = [option for _, option in agent._global_plan]
    assert options == [RoadOption(int(plan.option[i])) for i in plan.targets]
    assert RoadOption.CHANGELANELEFT in options or RoadOption.CHANGELANERIGHT in options


def test_leaderboard_two_keeps_fewer_points_and_calls_setup_itself(plan):
    """Straight on for 300 m: 50 m leaves a point each 52 steps, 200 m one and the last."""
    agent = told(plan, "localhost", 2000, False)
    assert not hasattr(agent, "config")
    carla = carla_values()
    straight = [(carla.Transform(carla.Location(x=float(x))), 4) for x in range(301)]
    assert downsample_route(straight, 200) == [0, 202, 300]
    assert downsample_route(straight, 50)[:3] == [0, 52, 104]
    assert downsample_route([], 50) == []
    assert len(agent._global_plan) <= len(told(plan, "")._global_plan)


def test_road_options_have_carlas_names_and_numbers():
    assert {option.name: option.value for option in RoadOption} == {
        "VOID": -1,
        "LEFT": 1,
        "RIGHT": 2,
        "STRAIGHT": 3,
        "LANEFOLLOW": 4,
        "CHANGELANELEFT": 5,
        "CHANGELANERIGHT": 6,
    }


def test_without_the_wheel_places_have_the_same_numbers():
    code = """
import sys
if sys.argv[1] == "without":
    sys.modules["carla"] = None
from agents.carla.values import carla_values
carla = carla_values()
here = carla.Transform(carla.Location(x=1.1, y=-2.2, z=3.3), carla.Rotation(yaw=91.7))
there = carla.Location(x=4.1, y=1.8)
print(here.location.x, here.location.y, here.location.z, here.rotation.yaw, here.rotation.pitch)
print(round(here.location.distance(there), 4))
print(type(here).__module__.partition(".")[0])
"""
    carla_wheel()
    told = [
        subprocess.run(
            [sys.executable, "-c", code, how], capture_output=True, text=True, check=True
        ).stdout.split("\n")
        for how in ("with", "without")
    ]
    assert told[0][:2] == told[1][:2]
    assert (told[0][2], told[1][2]) == ("carla", "agents")
