"""RouteVectorEnv against Gymnasium's own SyncVectorEnv of single environments, bit for bit."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import di_envs
from di_envs.config import OBSERVATION_GROUPS
from di_envs.route_env import RouteEnv
from di_envs.vector_env import RouteVectorEnv

TOY = "DriveInsight-Toy-v1"
N = 3
# the first drives as fast as it can and soon leaves its route, the others are cut off
ACTIONS = np.array([[1.0, 0.0, 0.0], [0.6, 0.3, 0.0], [0.5, -0.2, 0.0]], np.float32)
LIMIT = 70
GROUPS = ("prompt", "inertial")  # quick: cameras have a test of their own


def make_pair(mode, threads, **options):
    """Ours, and Gymnasium's of single environments."""
    ours = gymnasium.make_vec(
        TOY,
        num_envs=N,
        threads=threads,
        autoreset_mode=mode,
        max_episode_steps=LIMIT,
        **options,
    )
    theirs = SyncVectorEnv(
        [lambda: gymnasium.make(TOY, max_episode_steps=LIMIT, **options) for _ in range(N)],
        autoreset_mode=mode,
    )
    return ours, theirs


@pytest.fixture(scope="module")
def env():
    made = RouteVectorEnv(2, suite="toy", traffic=4, walkers=2, threads=1, observations=GROUPS)
    yield made
    made.close()


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_two_hundred_steps_are_those_of_single_environments(mode, threads):
    ours, theirs = make_pair(mode, threads, observations=GROUPS)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert data_equivalence(ours.reset(seed=11), theirs.reset(seed=11), exact=True)
    ended = np.zeros((2, N), int)
    for _ in range(200):
        step = ours.step(ACTIONS)
        assert data_equivalence(step, theirs.step(ACTIONS), exact=True)
        assert ours.observation_space.contains(step[0])
        ended += np.stack(step[2:4])
    assert (ended.sum(axis=0) >= 2).all(), "every world must have been reset automatically"
    assert (ended.sum(axis=1) > 0).all(), "some must have terminated, some been truncated"
    ours.close()
    theirs.close()


def test_sensors_in_threads_see_what_those_of_single_environments_see():
    """All of them, in a rainy night."""
    options = {"observations": OBSERVATION_GROUPS, "weather": "HardRainNight"}
    ours, theirs = make_pair(AutoresetMode.NEXT_STEP, 2, **options)
    assert data_equivalence(ours.reset(seed=4), theirs.reset(seed=4), exact=True)
    for _ in range(12):
        step = ours.step(ACTIONS)
        assert data_equivalence(step, theirs.step(ACTIONS), exact=True)
    front = step[0]["camera_front"]
    assert front.dtype == np.uint8
    assert front.shape[0] == N
    assert not np.array_equal(front[0], front[1])
    ours.close()
    theirs.close()


def test_worlds_of_other_numbers_of_actors_take_turns_in_one_working_memory():
    """Routes of a town with scenarios differ in whom they need; what one leaves, another finds."""
    options = {"suite": "town05_short", "observations": ("prompt",), "traffic": 20, "walkers": 10}
    ours = RouteVectorEnv(N, threads=1, **options)
    singles = [ours.envs[0].twin() for _ in range(N)]
    ours.reset(seed=7)
    for index, single in enumerate(singles):
        single.reset(seed=7 + index)
    assert len({single.view.capacity for single in singles}) > 1
    for _ in range(20):
        ours.step(ACTIONS)
        for index, single in enumerate(singles):
            single.step(ACTIONS[index])
    for one, single in zip(ours.envs, singles, strict=True):
        assert one.world.save().record.tobytes() == single.world.save().record.tobytes()
        assert data_equivalence(one.observe(), single.observe(), exact=True)


def test_what_costs_counts_in_its_world_also_in_one_that_is_put_there():
    """The first runs a red light, the second is put to where the first one then is."""
    options = {"suite": "toy", "traffic": 0, "walkers": 0, "observations": ("prompt",)}
    ours = RouteVectorEnv(2, threads=1, autoreset_mode="Disabled", **options)
    single = ours.envs[0].twin()
    ours.reset(seed=3)
    single.reset(seed=3)
    penalties = []
    for step in range(40):
        if step == 36:
            ours.envs[1].restore_state(single.save_state())
        _, rewards, _, _, infos = ours.step(ACTIONS[[0, 0]])
        _, reward, _, _, info = single.step(ACTIONS[0])
        for world in range(1 if step < 36 else 2):
            assert rewards[world] == reward
            for term, value in info["reward_terms"].items():
                assert infos["reward_terms"][term][world] == value
            for name in ("infraction_penalty", "driving_score", "events"):
                assert infos[name][world] == info[name]
        penalties.append(info["infraction_penalty"])
    assert penalties[0] == 1.0
    assert penalties[35] == 0.7


def test_without_autoreset_the_caller_resets_those_of_a_mask():
    ours, theirs = make_pair(AutoresetMode.DISABLED, 2, observations=GROUPS)
    ours.reset(seed=[5, 6, 7])
    theirs.reset(seed=[5, 6, 7])
    for _ in range(150):
        step = ours.step(ACTIONS)
        assert data_equivalence(step, theirs.step(ACTIONS), exact=True)
        mask = step[2] | step[3]
        if mask.any():
            again = ours.reset(options={"reset_mask": mask})
            assert data_equivalence(
                again, theirs.reset(options={"reset_mask": mask.copy()}), exact=True
            )
    ours.close()
    theirs.close()


def test_an_episode_that_is_over_is_not_stepped_without_autoreset():
    env = RouteVectorEnv(1, suite="toy", traffic=0, walkers=0, autoreset_mode="Disabled")
    env.reset(seed=1, options={"route": 0})
    over = False
    while not over:
        _, _, terminated, truncated, _ = env.step(ACTIONS[:1])
        over = terminated[0] or truncated[0]
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(ACTIONS[:1])


def test_a_restored_vector_goes_on_with_the_same_bits_past_resets():
    """Also in another one made alike, and in a wrapper that counts."""
    ours, _ = make_pair(AutoresetMode.NEXT_STEP, 2)
    env = RecordEpisodeStatistics(ours)
    env.reset(seed=21)
    for _ in range(60):
        env.step(ACTIONS)
    snapshot = di_envs.save(env)
    expected = [env.step(ACTIONS) for _ in range(40)]
    assert any((step[2] | step[3]).any() for step in expected)
    other = RecordEpisodeStatistics(make_pair(AutoresetMode.NEXT_STEP, 1)[0])
    for again in (env, other):
        di_envs.restore(again, snapshot)
        for step in expected:
            found = again.step(ACTIONS)
            for each in (found, step):  # wall-clock time of episodes, which no state holds
                each[4].get("episode", {}).pop("t", None)
            assert data_equivalence(found, step, exact=True)
    assert data_equivalence(ours.observe(), expected[-1][0], exact=True)
    with pytest.raises(ValueError, match="num_envs=3"):
        di_envs.restore(
            RecordEpisodeStatistics(RouteVectorEnv(2, suite="toy", traffic=4, walkers=2)), snapshot
        )


def test_an_observation_that_was_handed_out_does_not_change(env):
    before, _ = env.reset(seed=3)
    kept = {name: array.copy() for name, array in before.items()}
    for _ in range(5):
        env.step(ACTIONS[:2])
    assert all(np.array_equal(before[name], array) for name, array in kept.items())


def test_worlds_share_their_town_and_tables_and_nothing_that_changes(env):
    env.reset(seed=3)
    first, second = env.envs
    for one in env.envs:
        one.world.run(1)
    assert first.world.town is second.world.town
    assert first.plans is second.plans
    assert first.world._tables is second.world._tables
    assert not np.shares_memory(first.view.state.x, second.view.state.x)
    assert not np.shares_memory(
        first.world._scratch.acceleration, second.world._scratch.acceleration
    )


def test_a_twin_knows_nothing_of_the_episode_of_the_first():
    first = RouteEnv(suite="toy", traffic=4, walkers=2, observations=GROUPS)
    first.reset(seed=3)
    twin = first.twin()
    with pytest.raises(gymnasium.error.ResetNeeded):
        twin.step(ACTIONS[0])
    with pytest.raises(RuntimeError, match="no episode yet"):
        _ = twin.view
    assert data_equivalence(twin.reset(seed=3), first.reset(seed=3), exact=True)
    assert data_equivalence(twin.step(ACTIONS[0]), first.step(ACTIONS[0]), exact=True)


def test_a_refused_action_moves_no_world(env):
    env.reset(seed=3)
    with pytest.raises(ValueError, match="steer must be in"):
        env.step(np.array([[1.0, 0.0, 0.0], [1.0, np.nan, 0.0]], np.float32))
    assert [int(one.view.state.tick) for one in env.envs] == [0, 0]
    with pytest.raises(ValueError, match=r"shape \(2, 3\)"):
        env.step(np.zeros(3, np.float32))


def test_a_failure_in_a_thread_is_raised_where_step_was_called():
    env = RouteVectorEnv(2, suite="toy", traffic=4, walkers=2, threads=2)
    with pytest.raises(ValueError, match="route"):
        env.reset(seed=3, options={"route": "no such route"})
    env.close()


def test_attributes_and_methods_of_the_environments_can_be_asked_for(env):
    env.reset(seed=[3, 4])
    assert env.get_attr("np_random_seed") == (3, 4)
    assert [plan.route_id for plan in env.call("plan")] == [one.plan.route_id for one in env.envs]
    assert len(env.call("observe")) == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"num_envs": 0}, "num_envs must be at least 1"),
        ({"threads": 0}, "threads must be at least 1"),
        ({"max_episode_steps": 0}, "max_episode_steps must be at least 1"),
        ({"trafic": 3}, "did you mean 'traffic'"),
        ({"autoreset_mode": "Never"}, "Never"),
    ],
)
def test_a_refused_option_says_what_was_expected(options, message):
    with pytest.raises(ValueError, match=message):
        RouteVectorEnv(**{"suite": "toy", **options})


def test_as_many_seeds_as_worlds(env):
    with pytest.raises(ValueError, match="2 worlds"):
        env.reset(seed=[1, 2, 3])
    with pytest.raises(ValueError, match="reset_mask"):
        env.reset(options={"reset_mask": np.zeros(2, bool)})
