"""A function that learned elsewhere drives, by what its preset shows it."""

from __future__ import annotations

import numpy as np
import pytest

import di_envs
from agents.base import Requirements
from agents.learned import LearnedAgent
from di_envs.config import PRESETS
from leaderboard.running.driver import environment_options


def test_it_sees_what_an_environment_with_its_preset_shows_and_its_pedal_is_clipped():
    shown = []

    def policy(seen):
        shown.append(seen)
        return np.array([1.5, -0.25])

    quiet = {"suite": "toy", "observations": ("prompt",), "traffic": 3}
    agent = LearnedAgent(policy, control_dt_s=0.2)
    seen, _ = di_envs.RouteEnv(**quiet).reset(seed=2)
    control, _ = agent.act(seen, agent.start(None, 0))
    expected, _ = di_envs.RouteEnv(**quiet, preset="flat").reset(seed=2)
    np.testing.assert_array_equal(shown[0], expected)
    assert control.tolist() == [1.0, -0.25, 0.0]


def test_its_run_keeps_preset_groups_and_time():
    requires = LearnedAgent(abs, preset="box", control_dt_s=0.2, action="control").requires
    assert requires == Requirements(observations=("prompt",), control_dt_s=0.2, preset="box")


def test_what_there_is_not_is_refused_by_name():
    with pytest.raises(ValueError, match="did you mean 'pedal'"):
        LearnedAgent(abs, action="pedals")
    with pytest.raises(ValueError, match=f"known: {', '.join(PRESETS)}"):
        LearnedAgent(abs, preset="boxes")
    with pytest.raises(ValueError, match="did you mean 'flat'"):
        Requirements(preset="flt")


def test_a_preset_is_not_for_who_evaluates_to_choose():
    with pytest.raises(ValueError, match="leave preset out"):
        environment_options({"suite": "toy", "preset": "flat"}, Requirements())
