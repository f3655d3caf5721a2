"""Copies of environments go on as the first would, and neither moves the other."""

from __future__ import annotations

import copy
import os
import pickle

import cloudpickle
import gymnasium
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError
from gymnasium.wrappers import FrameStackObservation, TimeLimit
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import di_envs
from wrappers.actions import PedalWrapper

QUICK = {"observations": ("prompt",), "traffic": 3, "walkers": 2}
COPIES = {
    "deepcopy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
    "cloudpickle": lambda env: cloudpickle.loads(cloudpickle.dumps(env)),
}


def single():
    return di_envs.RouteEnv(suite="toy", **QUICK)


def wrapped():
    env = gymnasium.make("DriveInsight-Toy-v1", max_episode_steps=12, **QUICK)
    return FrameStackObservation(PedalWrapper(env), 2)


def vector():
    return di_envs.RouteVectorEnv(3, threads=2, suite="toy", max_episode_steps=12, **QUICK)


def wrapped_vector():
    return RecordEpisodeStatistics(gymnasium.make_vec("DriveInsight-Toy-v1", num_envs=2, **QUICK))


def parallel():
    return di_envs.parallel_env(2, suite="toy", **QUICK)


def begin(env):
    env.reset(seed=5)
    return go_on(env, 5)


def go_on(env, steps=10):
    """What comes of full throttle: all that the steps return, as bytes."""
    given = []
    for _ in range(steps):
        if hasattr(env, "possible_agents"):
            actions = {name: np.array([1.0, 0.0, 0.0], np.float32) for name in env.agents}
        else:
            actions = np.zeros(env.action_space.shape, np.float32)
            actions[..., 0] = 1.0
        given.append(pickle.dumps(env.step(actions)[:4]))
    return given


@pytest.mark.parametrize("kind", COPIES)
@pytest.mark.parametrize("make", [single, wrapped, vector, wrapped_vector, parallel])
def test_a_copy_goes_on_as_the_first_does_and_leaves_it_alone(make, kind):
    env = make()
    begin(env)
    twin = COPIES[kind](env)
    theirs = go_on(twin)
    assert go_on(env) == theirs
    assert type(twin) is type(env)


@pytest.mark.parametrize("kind", COPIES)
def test_a_copy_of_what_was_not_begun_begins_like_it(kind):
    env = single()
    assert begin(COPIES[kind](env)) == begin(env)


@pytest.mark.parametrize("kind", COPIES)
def test_a_copy_draws_the_same_actions_and_seeds(kind):
    env = single()
    env.reset(seed=5)
    env.action_space.seed(3)
    twin = COPIES[kind](env)
    assert twin.action_space.sample().tobytes() == env.action_space.sample().tobytes()
    assert twin.reset()[1]["world_seed"] == env.reset()[1]["world_seed"]


class Noting(di_envs.RouteEnv):
    """An environment of one's own, with another signature and something to remember."""

    def __init__(self, note):
        self.early = [note]
        super().__init__(suite="toy", **QUICK)
        self.note = [note]


@pytest.mark.parametrize("kind", COPIES)
def test_what_a_class_of_ones_own_has_added_is_copied_too(kind):
    env = Noting("first")
    twin = COPIES[kind](env)
    twin.note.append("second")
    twin.early.append("second")
    assert (env.note, env.early) == (["first"], ["first"])
    assert (twin.note, twin.early, twin.unwrapped) == (["first", "second"],) * 2 + (twin,)


class Looking(gymnasium.Wrapper):
    """Holds a part of the environment inside."""

    def __init__(self, env):
        super().__init__(env)
        self.world = env.world


def test_a_wrapper_that_holds_the_world_holds_the_copys_world_in_the_copy():
    twin = copy.deepcopy(Looking(TimeLimit(single(), 9).env))
    assert twin.world is twin.env.world


def test_an_environment_of_threads_made_before_a_fork_steps_in_the_child():
    env = vector()
    expected = begin(env)
    pid = os.fork()
    if pid == 0:
        same = False
        try:
            same = begin(env) == expected
        finally:
            os._exit(0 if same else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
    assert begin(env) == expected  # and the parent's threads are as they were


def test_a_closed_environment_says_that_it_is_closed():
    env = vector()
    begin(env)
    env.close()
    env.close()
    for call in (env.reset, env.observe, lambda: go_on(env, 1)):
        with pytest.raises(ClosedEnvironmentError, match="is closed: make another"):
            call()
