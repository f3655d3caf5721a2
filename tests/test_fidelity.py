"""What docs/fidelity.md says that this world leaves out of CARLA's is really not there."""

from __future__ import annotations

import inspect
import math

import numpy as np
import pytest

from di_envs.route_env import RouteEnv
from di_envs.sensors.scene.scene import scene_of
from di_envs.sensors.scene.tags import Tag
from di_envs.world.dynamics import EgoModel, longitudinal_acceleration, move_ego
from di_envs.world.kinds import ActorKind
from di_envs.world.state import Capacity, state_dtype, views_of

AHEAD = np.array([0.5, 0.1, 0.0], np.float32)
TOY = {"suite": "toy", "observations": ("inertial",)}


def driven(steps, **options):
    env = RouteEnv(**TOY, **options)
    env.reset(seed=3, options={"route": 0})
    for _ in range(steps):
        env.step(AHEAD)
    return env


def test_weather_moves_nobody():
    dry, wet = (
        driven(30, traffic=8, walkers=4, weather=weather).world.save().record
        for weather in ("ClearNoon", "HardRainNoon")
    )
    assert dry.tobytes() == wet.tobytes()


def test_traffic_neither_comes_nor_goes():
    env = driven(0, traffic=8, walkers=4)
    before = env.view.state.kind.copy()
    env.world.advance(np.zeros((1, 3)), 1200)
    after = env.view.state.kind
    vehicles = slice(1, 9)
    assert (before[vehicles] != ActorKind.ABSENT).all()
    assert after[vehicles].tolist() == before[vehicles].tolist()


def test_tyres_hold_at_any_speed():
    """Full steer at 20 m/s: atan(1.068 tan 0.368) = 0.391, yaw rate 20 sin(0.391) / 1.418."""
    state = views_of(np.zeros(1, state_dtype(Capacity(1, 0, 0, 0, 0, 0))))
    state.speed[0], state.steer[0], state.wheel[0] = 20.0, 1.0, 1.0
    state.tick[()] = 1
    move_ego(state, 0, EgoModel().parameters())
    sideways_mps2 = state.speed[0] * state.yaw_rate[0]
    assert state.yaw_rate[0] == pytest.approx(20.0 * math.sin(0.391) / 1.418, rel=0.02)
    assert sideways_mps2 > 10 * 9.81


def test_neither_slope_nor_weather_is_in_the_cars_acceleration():
    names = list(inspect.signature(longitudinal_acceleration).parameters)
    assert names == ["speed_mps", "throttle", "brake", "model"]


def test_buildings_and_trees_are_seen_but_not_solid():
    env = driven(0, traffic=0, walkers=0)
    boxes = scene_of(env.world.town).boxes
    there = np.flatnonzero(boxes.tag[: boxes.count[0]] == Tag.BUILDINGS)
    assert there.size > 3
    state = env.world._state
    for box in there[:4]:
        state.x[0], state.y[0] = boxes.centre[box, :2]
        state.speed[0] = 5.0
        env.world.advance(np.array([[0.5, 0.0, 0.0]]))
        assert state.speed[0] > 5.0
    assert not state.counts[0, 1:4].any()
