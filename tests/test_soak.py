"""The soak of benchmarks/, shorter: nothing leaks and nothing strays with every sensor on."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from di_envs.route_env import RouteEnv

SCRIPT = Path(__file__).resolve().parent.parent / "benchmarks" / "soak.py"


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("soak", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["soak"] = module  # where dataclasses look for it
    spec.loader.exec_module(module)
    yield module
    del sys.modules["soak"]


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


def test_five_hundred_steps_with_every_sensor_leak_nothing_and_stay_in_their_space(script):
    found = script.soak(lambda weather: script.all_sensors("toy", weather), 500)
    assert found.faults == ()
    assert found.growth_mb < 20.0
    assert len(found.memory_mb) == 11
    assert found.episodes >= 3
    assert len(found.weathers) >= 3


def quiet(weather):
    return RouteEnv(suite="toy", observations=("prompt",), traffic=0, walkers=0, weather=weather)


def test_a_leak_is_noticed(script):
    found = script.soak(lambda weather: Hoarder(quiet(weather)), 120)
    Hoarder.kept.clear()
    # 90 MB are kept; what other tests have left to be freed meanwhile makes it look less
    assert 50.0 < found.growth_mb < 100.0


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
