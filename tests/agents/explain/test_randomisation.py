"""Explanations depend on the weights: shuffled, they show something else."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from agents.explain.randomisation import randomisation_check, rank_correlation
from tests.agents.explain.small_policy import agent_of, moment_of, save_policy


def test_rank_correlation_by_hand():
    assert rank_correlation([1, 2, 3], [10, 20, 90]) == pytest.approx(1.0)
    assert rank_correlation([1, 2, 3], [3, 2, 1]) == pytest.approx(-1.0)
    assert rank_correlation([1, 1, 1], [3, 2, 1]) == 0.0
    # ranks 1.5 1.5 3 and 1 2 3: less their means -.5 -.5 1 and -1 0 1, so 1.5 / sqrt(1.5 * 2)
    assert rank_correlation([4, 4, 9], [1, 2, 3]) == pytest.approx(1.5 / np.sqrt(3.0))


def test_maps_change_as_weights_are_shuffled_and_the_weights_come_back(tmp_path):
    agent = agent_of(save_policy(tmp_path))
    moment = moment_of(agent)
    before = {name: value.clone() for name, value in agent.policy.state_dict().items()}
    found = randomisation_check(agent, *moment)
    assert [each.parts[-1] for each in found][:2] == ["planner", "prompt"]
    assert found[-1].parts[-1] == "perception"
    assert abs(found[-1].maps["bev"]) < 0.7
    assert all(each.waypoints_m > 0.0 for each in found)
    after = agent.policy.state_dict()
    assert all(torch.equal(value, after[name]) for name, value in before.items())


def test_the_same_seed_shuffles_the_same_way(tmp_path):
    agent = agent_of(save_policy(tmp_path))
    moment = moment_of(agent, steps=1)
    first, again = (randomisation_check(agent, *moment, parts=["planner"]) for _ in range(2))
    assert first == again


def test_an_unknown_part_is_refused_with_the_nearest(tmp_path):
    agent = agent_of(save_policy(tmp_path))
    with pytest.raises(ValueError, match="did you mean 'planner'"):
        randomisation_check(agent, *moment_of(agent, steps=1), parts=["planer"])
