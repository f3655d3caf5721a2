"""Observations as vectors in [-1, 1]."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from di_envs.observation import observation_space
from di_envs.testing import check_environment
from di_envs.vectors import as_vector, as_vectors_space, vector_space
from wrappers.vectors import VectorObservations

TOY = "DriveInsight-Toy-v1"


def test_each_number_is_divided_by_the_largest_it_can_be():
    space = gymnasium.spaces.Box(
        np.array([[-100.0, 0.0], [-100.0, 0.0]], np.float32),
        np.array([[100.0, 8.0], [100.0, 8.0]], np.float32),
    )
    got = as_vector(np.array([[50.0, 2.0], [-100.0, 0.0]], np.float32), space)
    assert got.tolist() == [0.5, 0.25, -1.0, 0.0]
    assert vector_space(space).low.tolist() == [-1.0, 0.0, -1.0, 0.0]
    assert vector_space(space).high.tolist() == [1.0, 1.0, 1.0, 1.0]


def test_every_table_becomes_one_row_and_images_and_choices_stay():
    space = observation_space(("prompt", "camera", "lidar", "inertial"))
    vectors = as_vectors_space(space)
    assert vectors["map"].shape == (64 * 10 * 4,)
    assert vectors["lidar"].shape == (5600 * 4,)
    for name in ("camera_front", "command", "prompt_present"):
        assert vectors[name] == space[name]


def test_a_wrapped_environment_keeps_every_promise_of_ours():
    def make():
        return VectorObservations(gymnasium.make(TOY, observations="rl", traffic=4))

    check_environment(make, steps=15)


def test_what_is_no_dict_is_refused():
    with pytest.raises(ValueError, match="Dict"):
        VectorObservations(gymnasium.make("CartPole-v1"))
