"""Saving, branching and restoring environments with the memory of their wrappers."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import (
    FrameStackObservation,
    NormalizeReward,
    RecordEpisodeStatistics,
    TimeLimit,
    TransformReward,
)

import di_envs
from di_envs.route_env import RouteEnv
from di_envs.testing import check_environment, drive

GO = np.array([0.5, 0.0, 0.0], np.float32)


GROUPS = ("prompt", "inertial")  # quick: what is saved does not depend on them


def raw():
    return RouteEnv(suite="toy", observations=GROUPS)


class SpeedStack(gymnasium.ObservationWrapper):
    """Sees the speed alone; plain arrays suit Gymnasium's stacking."""

    def __init__(self, env):
        super().__init__(env)
        self.observation_space = env.observation_space["speed"]

    def observation(self, observation):
        return observation["speed"]


class Odometer(gymnasium.Wrapper):
    """Says itself what its memory is, and holds what cannot be copied."""

    def __init__(self, env):
        super().__init__(env)
        self.steps = 0
        self.uncopyable = (step for step in ())

    def step(self, action):
        self.steps += 1
        return self.env.step(action)

    def save_state(self):
        return self.steps

    def restore_state(self, value):
        self.steps = value


def wrapped():
    made = gymnasium.make("DriveInsight-Toy-v1", observations=GROUPS)
    env = TimeLimit(RecordEpisodeStatistics(made), 1000)
    env = NormalizeReward(FrameStackObservation(SpeedStack(env), 3))
    return TransformReward(Odometer(env), lambda reward: reward)


@pytest.mark.parametrize("begin", [0, 1, 25])
def test_a_restored_episode_goes_on_with_the_same_bits(begin):
    env = raw()
    drive(env, 4, begin)
    snapshot = di_envs.save(env)
    first = drive(env, 4, 40, begin=False)
    drive(env, 5, 10)
    di_envs.restore(env, snapshot)
    assert drive(env, 4, 40, begin=False) == first


def test_a_snapshot_shares_nothing_and_serves_any_number_of_branches():
    env = raw()
    drive(env, 4, 10)
    snapshot = di_envs.save(env)
    branches = set()
    for _ in range(3):
        di_envs.restore(env, snapshot)
        branches.add(drive(env, 4, 20, begin=False))
    di_envs.restore(env, snapshot)
    branches.add(drive(env, 8, 20, begin=False))  # other actions: another way
    assert len(branches) == 2


def test_resets_after_a_restore_continue_the_saved_sequence():
    env = raw()
    env.reset(seed=3)
    snapshot = di_envs.save(env)
    seeds = []
    for _ in range(2):
        env.reset()
        seeds.append(int(env.view.state.seed))
        di_envs.restore(env, snapshot)
    assert seeds[0] == seeds[1]


def test_a_snapshot_of_before_the_first_reset_has_no_episode():
    env = raw()
    snapshot = di_envs.save(env)
    env.reset(seed=0)
    di_envs.restore(env, snapshot)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(GO)


def test_an_ended_episode_is_restored_as_ended():
    env = RouteEnv(suite="toy", traffic=0, walkers=0, control_dt_s=5.0, observations=GROUPS)
    env.reset(seed=0, options={"route": "0"})
    begun = di_envs.save(env)
    while not any(env.step(np.zeros(3, np.float32))[2:4]):
        pass
    ended = di_envs.save(env)
    di_envs.restore(env, begun)
    env.step(GO)
    di_envs.restore(env, ended)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(GO)


def test_a_chain_of_wrappers_with_memory_is_saved_whole():
    check_environment(wrapped, steps=30)


def test_a_time_limit_counts_on_from_the_snapshot():
    env = TimeLimit(raw(), 10)
    env.reset(seed=0)
    for _ in range(4):
        env.step(GO)
    snapshot = di_envs.save(env)
    for _ in range(2):
        di_envs.restore(env, snapshot)
        steps = 1
        while not env.step(GO)[3]:
            steps += 1
        assert steps == 6


def test_a_wrapper_may_say_itself_what_it_remembers():
    env = Odometer(raw())
    drive(env, 0, 7)
    snapshot = di_envs.save(env)
    drive(env, 0, 5, begin=False)
    di_envs.restore(env, snapshot)
    assert env.steps == 7


def test_a_memory_that_cannot_be_copied_is_refused_with_the_cure():
    class Hoarder(gymnasium.Wrapper):
        def __init__(self, env):
            super().__init__(env)
            self.file = (step for step in ())

    with pytest.raises(TypeError, match=r"Hoarder cannot be copied.*save_state\(\)"):
        di_envs.save(Hoarder(raw()))


def test_an_environment_that_cannot_save_itself_is_refused():
    with pytest.raises(TypeError, match="CartPoleEnv cannot be saved"):
        di_envs.save(gymnasium.make("CartPole-v1"))


def test_a_snapshot_of_other_layers_is_refused():
    env = raw()
    env.reset(seed=0)
    with pytest.raises(ValueError, match="layers RouteEnv, but this environment has TimeLimit"):
        di_envs.restore(TimeLimit(raw(), 10), di_envs.save(env))


def test_a_snapshot_of_another_town_or_traffic_is_refused():
    env = raw()
    env.reset(seed=0)
    snapshot = di_envs.save(env)
    with pytest.raises(ValueError, match="numbers of actors"):
        di_envs.restore(RouteEnv(suite="toy", traffic=3), snapshot)
