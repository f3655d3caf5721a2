"""The soak of benchmarks/, shorter: nothing leaks and nothing strays with every sensor on."""

from __future__ import annotations

import dataclasses
import importlib.util
import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from di_envs.route_env import RouteEnv

SCRIPT = Path(__file__).resolve().parent.parent / "benchmarks" / "soak.py"


def loaded():
    spec = importlib.util.spec_from_file_location("soak", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["soak"] = module  # where dataclasses look for it
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def script():
    yield loaded()
    del sys.modules["soak"]


def in_a_fresh_process(function):
    """What a function returns where no other test has left memory to be freed meanwhile."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(function).result()


class Hoarder(gymnasium.Wrapper):
    """Keeps a megabyte a step: what a leak looks like."""

    kept: list[np.ndarray] = []  # noqa: RUF012 (across episodes, as leaks are)

    def step(self, action):
        self.kept.append(np.ones(2**17))
        return self.env.step(action)


class Blinded(gymnasium.Wrapper):
    """Says at its 30th step that it drives at no speed at all, not even zero."""

    steps = 0

    def step(self, action):
        observation, *rest = self.env.step(action)
        self.steps += 1
        if self.steps == 30:
            observation = {**observation, "speed": np.full(1, np.nan, np.float32)}
        return observation, *rest


def soaked_with_every_sensor():
    script = loaded()
    return dataclasses.asdict(script.soak(lambda w: script.all_sensors("toy", w), 500))


def test_five_hundred_steps_with_every_sensor_leak_nothing_and_stay_in_their_space():
    found = in_a_fresh_process(soaked_with_every_sensor)
    assert found["faults"] == ()
    assert found["memory_mb"][-1] - found["memory_mb"][0] < 20.0
    assert len(found["memory_mb"]) == 11
    assert found["episodes"] >= 3
    assert len(found["weathers"]) >= 3


def quiet(weather):
    return RouteEnv(suite="toy", observations=("prompt",), traffic=0, walkers=0, weather=weather)


def growth_with_a_leak():
    return loaded().soak(lambda weather: Hoarder(quiet(weather)), 120).growth_mb


def test_a_leak_is_noticed():
    assert in_a_fresh_process(growth_with_a_leak) == pytest.approx(90.0, abs=5.0)


def test_what_is_not_a_number_is_noticed(script):
    found = script.soak(lambda weather: Blinded(quiet(weather)), 40)
    assert len(found.faults) == 1
    assert found.faults[0].startswith("step 30, ")
    assert "'speed' holds NaN" in found.faults[0]


def test_what_is_outside_its_space_or_has_no_place_in_it_is_noticed(script):
    env = quiet("ClearNoon")
    observation, _ = env.reset(seed=0)
    assert script.fault_of(env.observation_space, observation) == ""
    fast = {**observation, "speed": np.full(1, 101.0, np.float32)}
    assert script.fault_of(env.observation_space, fast) == "'speed' is not in its space"
    assert "keys" in script.fault_of(env.observation_space, {**observation, "more": 1})
