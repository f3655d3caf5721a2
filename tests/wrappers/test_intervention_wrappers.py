"""The same edits around one environment, many, and several egos: the same bits, saved with them."""

from __future__ import annotations

import warnings

import gymnasium
import numpy as np
import pytest

import di_envs
from di_envs.edits.text import EditError
from di_envs.multi_ego import MultiEgoEnv
from di_envs.route_env import RouteEnv
from di_envs.testing import check_environment
from di_envs.vector_env import RouteVectorEnv
from wrappers.interventions import InterventionWrapper, VectorInterventions
from wrappers.interventions.parallel import ParallelInterventions
from wrappers.vectors import VectorObservations

with warnings.catch_warnings():  # its tests import a game of its own in a way it deprecates
    warnings.simplefilter("ignore", DeprecationWarning)
    from pettingzoo.test import parallel_api_test

TOY = "DriveInsight-Toy-v1"
EDITS = "noise:map,sigma=0.5; mask:obstacles,p=0.3@t>1; delay:speed+routing,steps=3; drop:speed@t>2"
OPTIONS = {"suite": "town05_tiny", "observations": ("prompt",), "traffic": 20, "walkers": 5}
GO = np.array([0.5, 0.0, 0.0], np.float32)


def same(one, other):
    return all(np.array_equal(one[name], other[name]) for name in one)


def drive(env, steps, seed=7, route=0):
    shown = [env.reset(seed=seed, options={"route": route})[0]]
    return shown + [env.step(GO)[0] for _ in range(steps)]


def test_a_wrapped_environment_keeps_every_promise_of_ours():
    def make():
        return InterventionWrapper(gymnasium.make(TOY, observations=("prompt",), traffic=4), EDITS)

    check_environment(make, steps=30)


def test_only_what_is_seen_is_edited():
    plain, edited = RouteEnv(**OPTIONS), InterventionWrapper(RouteEnv(**OPTIONS), EDITS)
    for env in (plain, edited):
        env.reset(seed=7, options={"route": 0})
    for _ in range(25):
        raw, *real = plain.step(GO)
        shown, *told = edited.step(GO)
        assert real == told
    assert np.array_equal(plain.view.state.x, edited.unwrapped.view.state.x)
    assert same(edited.unwrapped.observe(), raw)
    assert not same(shown, raw)


def test_looking_again_shows_the_same_and_remembers_nothing_twice():
    env = InterventionWrapper(RouteEnv(**OPTIONS), EDITS)
    with pytest.raises(RuntimeError):
        env.observe()
    shown = drive(env, 6)
    assert same(env.observe(), shown[-1])
    assert same(env.step(GO)[0], drive(env, 7)[-1])


def test_a_restored_environment_goes_on_with_the_same_bits():
    env = InterventionWrapper(RouteEnv(**OPTIONS), EDITS)
    drive(env, 8)
    snapshot = di_envs.save(env)
    ahead = [env.step(GO)[0] for _ in range(5)]
    drive(env, 3, seed=1, route=1)
    di_envs.restore(env, snapshot)
    assert all(same(one, env.step(GO)[0]) for one in ahead)


def test_wrappers_that_change_the_form_go_outside():
    env = VectorObservations(InterventionWrapper(RouteEnv(**OPTIONS), "set:speed=50"))
    observation, _ = env.reset(seed=0)
    assert observation["speed"].tolist() == [0.5]


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_each_of_many_worlds_is_shown_what_it_is_shown_alone(mode):
    """Past the ends of episodes too: each begins with nothing to remember."""
    worlds = VectorInterventions(
        RouteVectorEnv(2, threads=1, autoreset_mode=mode, terminate_on=("red_light",),
                       max_episode_steps=6, **OPTIONS), EDITS,
    )  # fmt: skip
    rows, _ = worlds.reset(seed=[3, 4], options={"route": 0})
    singles = [InterventionWrapper(RouteEnv(**OPTIONS), EDITS) for _ in range(2)]
    shown = [
        env.reset(seed=seed, options={"route": 0})[0]
        for env, seed in zip(singles, (3, 4), strict=True)
    ]
    steps, _began = 0, True
    for _ in range(16):
        for row, own in enumerate(shown):
            assert all(np.array_equal(rows[name][row], own[name]) for name in own), steps
        rows, *_, info = worlds.step(np.stack([GO, GO]))
        if steps == 6:  # NextStep: this step only began anew
            shown, steps = [env.reset()[0] for env in singles], 0
            continue
        shown, steps = [env.step(GO)[0] for env in singles], steps + 1
        if steps == 6 and mode == "SameStep":
            for row, own in enumerate(shown):
                assert same(info["final_obs"][row], own)
            shown, steps = [env.reset()[0] for env in singles], 0


def test_worlds_that_a_mask_leaves_alone_are_shown_the_same_again():
    worlds = VectorInterventions(RouteVectorEnv(2, threads=1, **OPTIONS), EDITS)
    worlds.reset(seed=3)
    for _ in range(12):
        before, *_ = worlds.step(np.stack([GO, GO]))
    after, _ = worlds.reset(seed=9, options={"reset_mask": np.array([True, False])})
    assert all(np.array_equal(before[name][1], after[name][1]) for name in before)
    assert not np.array_equal(before["map"][0], after["map"][0])


def test_a_restored_vector_goes_on_with_the_same_bits():
    worlds = VectorInterventions(RouteVectorEnv(2, threads=1, **OPTIONS), EDITS)
    worlds.reset(seed=3)
    for _ in range(12):
        worlds.step(np.stack([GO, GO]))
    snapshot = di_envs.save(worlds)
    ahead = [worlds.step(np.stack([GO, GO]))[0] for _ in range(4)]
    di_envs.restore(worlds, snapshot)
    assert all(same(one, worlds.step(np.stack([GO, GO]))[0]) for one in ahead)


def test_egos_are_edited_each_by_itself():
    plain = MultiEgoEnv(2, **OPTIONS)
    edited = ParallelInterventions(
        MultiEgoEnv(2, **OPTIONS), {"ego_1": "noise:map,sigma=0.5; delay:speed,steps=2"}
    )
    plain.reset(seed=3)
    edited.reset(seed=3)
    for _ in range(3):
        raw, *_ = plain.step({"ego_0": GO, "ego_1": GO})
        shown, *_ = edited.step({"ego_0": GO, "ego_1": GO})
    assert same(raw["ego_0"], shown["ego_0"])
    assert not np.array_equal(raw["ego_1"]["map"], shown["ego_1"]["map"])
    state = edited.save_state()
    actions = {"ego_0": GO, "ego_1": GO}
    ahead = edited.step(actions)[0]["ego_1"]
    edited.restore_state(state)
    assert same(ahead, edited.step(actions)[0]["ego_1"])
    with pytest.raises(EditError, match="did you mean 'ego_1'"):
        ParallelInterventions(plain, {"ego1": "drop:map"})


def test_two_egos_have_noise_of_their_own_and_the_first_that_of_a_single_one():
    env = ParallelInterventions(MultiEgoEnv(2, **OPTIONS), "noise:speed,sigma=1")
    shown, _ = env.reset(seed=3)
    speeds = [float(shown[name]["speed"][0]) for name in ("ego_0", "ego_1")]
    assert speeds[0] != speeds[1]
    single = InterventionWrapper(RouteEnv(**OPTIONS), "noise:speed,sigma=1")
    assert speeds[0] == single.reset(seed=3)[0]["speed"][0]


def test_pettingzoos_own_test_passes():
    env = ParallelInterventions(
        MultiEgoEnv(2, suite="toy", observations=("prompt",), traffic=4), EDITS
    )
    parallel_api_test(env, num_cycles=20)


def test_info_says_how_far_the_next_junction_is():
    env = RouteEnv(**OPTIONS)
    _, info = env.reset(seed=0, options={"route": 0})
    inside = env.view.town.lanes.junction[env.plan.lane] >= 0
    first = int(np.argmax(inside))
    assert info["junction_m"] == pytest.approx(env.plan.route_m[first])
    assert info["world_seed"] == 0
    last = int(np.flatnonzero(inside)[-1])
    table = env._course.junction_m[env.plan.route_id]
    assert not table[inside].any()
    assert np.isinf(table[last + 1 :]).all()
