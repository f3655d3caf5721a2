"""The observation space and the observer: groups, shapes, fresh arrays."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium import spaces

from di_envs.config import RouteEnvConfig
from di_envs.observation import observation_space
from di_envs.prompt import COMPONENTS
from tests.hand_made import Scene, toy_plan, toy_town

PROMPT = {*COMPONENTS, "prompt_present"}
INERTIAL = {"imu", "gnss", "speed"}


@pytest.fixture(scope="module")
def scene():
    town = toy_town()
    return Scene(town, toy_plan(town))


@pytest.mark.parametrize(
    ("groups", "keys"),
    [(("prompt",), PROMPT), (("inertial",), INERTIAL), (("inertial", "prompt"), PROMPT | INERTIAL)],
)
def test_groups_choose_the_keys(scene, groups, keys):
    assert set(observation_space(groups).spaces) == keys
    assert set(scene.observe(groups)) == keys


def test_the_space_is_flat_and_has_the_documented_shapes():
    space = observation_space(("prompt", "inertial"))
    shapes = {name: part.shape for name, part in space.spaces.items()}
    assert shapes == {
        "command": (),
        "target_point": (3,),
        "routing": (50, 4),
        "map": (64, 10, 4),
        "obstacles": (32, 9),
        "traffic_lights": (8, 5),
        "stop_signs": (4, 4),
        "speed": (1,),
        "speed_history": (4,),
        "prompt_present": (9,),
        "imu": (7,),
        "gnss": (3,),
    }
    assert space["command"] == spaces.Discrete(7)
    assert space["prompt_present"] == spaces.MultiBinary(9)


def test_every_component_is_given_in_the_order_of_the_flags(scene):
    assert scene.observe()["prompt_present"].tolist() == [1] * 9
    assert COMPONENTS == (
        "command",
        "target_point",
        "routing",
        "map",
        "obstacles",
        "traffic_lights",
        "stop_signs",
        "speed",
        "speed_history",
    )


def test_the_gnss_is_double_precision_as_half_a_metre_is_lost_in_single(scene):
    assert scene.observe(("inertial",))["gnss"].dtype == np.float64
    assert float(np.spacing(np.float32(49.0))) * 111_000 > 0.4  # metres a step of float32 at 49°


def test_the_speedometer_shows_what_the_prompt_does(scene):
    scene.put(0, *scene.plan.points[0], speed=7.25)
    alone, beside = scene.observe(("inertial",)), scene.observe(("prompt", "inertial"))
    assert alone["speed"] == beside["speed"] == np.float32([7.25])
    assert alone["speed"].dtype == np.float32


def test_the_preset_for_reinforcement_learning_is_the_prompt_and_one_small_camera():
    preset = RouteEnvConfig(suite="toy", observations="rl")
    assert preset == RouteEnvConfig(suite="toy", observations=("prompt", "camera"), cameras="rl")


def test_an_unknown_preset_and_one_with_another_rig_are_refused():
    with pytest.raises(ValueError, match="preset of observations 'rk'"):
        RouteEnvConfig(suite="toy", observations="rk")
    with pytest.raises(ValueError, match="chooses the rig 'rl'"):
        RouteEnvConfig(suite="toy", observations="rl", cameras="paper")
    with pytest.raises(ValueError, match="tuple of names"):
        RouteEnvConfig(suite="toy", observations="prompt")
