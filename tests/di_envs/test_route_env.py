"""RouteEnv in the toy town: Gymnasium's contract, seeds, routes, endings and the reward."""

from __future__ import annotations

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import di_envs  # noqa: F401 (registers the ids)
from di_envs.route_env import RouteEnv
from di_envs.testing import check_environment, drive
from di_envs.world.state import EventKind

FULL_THROTTLE = np.array([1.0, 0.0, 0.0], np.float32)
STAND = np.array([0.0, 0.0, 1.0], np.float32)
GROUPS = ("prompt", "inertial")  # quick: pictures have tests of their own


@pytest.fixture(scope="module")
def env():
    return RouteEnv(suite="toy", observations=GROUPS)


@pytest.fixture(scope="module")
def empty():
    """Nobody else on the road, decisions every second."""
    return RouteEnv(suite="toy", traffic=0, walkers=0, control_dt_s=1.0, observations=GROUPS)


def run(env, action, **reset):
    """Drives to the end with one action: all steps' results."""
    env.reset(**reset)
    results = [env.step(action)]
    while not (results[-1][2] or results[-1][3]):
        results.append(env.step(action))
    return results


def test_gymnasiums_checker_has_nothing_to_say(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")  # it opens a window too
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = gymnasium.make("DriveInsight-Toy-v1")
        check_env(made.unwrapped)
        made.close()


def test_our_own_conformance_checks_pass():
    check_environment(lambda: RouteEnv(suite="toy", control_dt_s=0.05), steps=40)


# ---- seeds and routes


def test_a_seed_and_a_route_fix_the_episode_whatever_came_before(env):
    first = drive(env, 5, 30)
    env.reset()
    drive(env, 6, 10)
    assert drive(env, 5, 30) == first
    assert drive(env, 6, 30) != first


def test_resets_without_a_seed_continue_the_sequence_of_the_last_seed(env):
    def three_worlds():
        env.reset(seed=9)
        seeds = [int(env.view.state.seed)]
        for _ in range(2):
            env.reset()
            seeds.append(int(env.view.state.seed))
        return seeds

    seeds = three_worlds()
    assert seeds[0] == 9
    assert len(set(seeds)) == 3
    assert three_worlds() == seeds


def test_the_seed_draws_every_route_sooner_or_later(env):
    drawn = {env.reset(seed=seed)[1]["route_id"] for seed in range(60)}
    assert drawn == set(env.route_ids)


def test_a_route_is_chosen_by_index_or_by_id():
    env = RouteEnv(suite="toy", route_ids=("2", "4"))
    assert env.route_ids == ("2", "4")
    assert env.reset(seed=0, options={"route": 1})[1]["route_id"] == "4"
    assert env.reset(seed=0, options={"route": np.int64(0)})[1]["route_id"] == "2"
    assert env.reset(seed=0, options={"route": "4"})[1]["route_id"] == "4"
    assert env.plan.route_id == "4"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rout": 1}, r"'rout'; did you mean 'route'\?"),
        ({"route": 7}, r"7 is not in 0..6; for the route whose id is 7 give the string '7'"),
        ({"route": -1}, "-1 is not in 0..6"),
        ({"route": "77"}, "Unknown route id '77'"),
        ({"route": 1.0}, r"an id \(str\) or an index \(int\)"),
        ({"route": True}, r"an id \(str\) or an index \(int\)"),
    ],
)
def test_an_unknown_route_or_reset_option_is_refused(env, options, message):
    with pytest.raises(ValueError, match=message):
        env.reset(seed=0, options=options)


def test_seeds_that_do_not_fit_are_refused(env):
    with pytest.raises(ValueError, match=r"0 to 2\*\*63 - 1"):
        env.reset(seed=2**63)
    with pytest.raises(gymnasium.error.Error):
        env.reset(seed=-1)


def test_unknown_routes_and_suites_are_refused_when_the_environment_is_made():
    with pytest.raises(ValueError, match="Unknown route id"):
        RouteEnv(suite="toy", route_ids=("99",))
    with pytest.raises(ValueError, match=r"'tony'; did you mean 'toy'\?"):
        RouteEnv(suite="tony")


# ---- steps


@pytest.mark.parametrize("wrap", [False, True])
def test_a_step_before_the_first_reset_is_refused(wrap):
    env = gymnasium.make("DriveInsight-Toy-v1") if wrap else RouteEnv(suite="toy")
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        env.step(STAND)


def test_looking_before_the_first_reset_is_refused():
    env = RouteEnv(suite="toy")
    with pytest.raises(RuntimeError, match="reset"):
        env.observe()
    with pytest.raises(RuntimeError, match="reset"):
        _ = env.plan


def test_a_bad_action_is_refused_and_moves_nothing(env):
    env.reset(seed=0)
    for action in ([0.0, 0.0], [np.nan, 0.0, 0.0], [2.0, 0.0, 0.0]):
        with pytest.raises(ValueError, match="ction"):
            env.step(np.array(action))
    assert int(env.view.state.tick) == 0


def test_a_step_takes_the_control_time(env, empty):
    env.reset(seed=0)
    assert env.step(STAND)[4]["game_time_s"] == pytest.approx(0.1)
    empty.reset(seed=0)
    assert empty.step(STAND)[4]["game_time_s"] == pytest.approx(1.0)


def test_the_present_observation_can_be_had_again(env):
    env.reset(seed=0)
    seen, *_ = env.step(FULL_THROTTLE)
    again = env.observe()
    assert all(np.array_equal(seen[name], again[name]) for name in seen)
    assert not np.shares_memory(seen["map"], again["map"])


def test_the_speed_told_is_the_egos(env):
    env.reset(seed=0)
    for _ in range(30):
        seen, *_ = env.step(FULL_THROTTLE)
    assert seen["speed"][0] == np.float32(env.view.state.speed[0])
    assert seen["speed"][0] > seen["speed_history"][0] > seen["speed_history"][1] > 0.0


# ---- endings


def test_the_timeout_truncates_an_ego_that_stands_on_a_short_route(empty):
    *_, last = run(empty, STAND, seed=0, options={"route": "0"})
    _, _, terminated, truncated, info = last
    assert (terminated, truncated) == (False, True)
    assert info["finished"] == "timeout"
    assert info["game_time_s"] == pytest.approx(empty.plan.timeout_s, abs=1.0)
    assert info["driving_score"] == 0.0
    assert [event.kind for event in info["events"]] == [EventKind.TIMEOUT]


def test_full_throttle_straight_on_leaves_the_route_or_reaches_its_end(empty):
    *_, last = run(empty, FULL_THROTTLE, seed=0, options={"route": "1"})  # which turns right
    assert last[2] is True
    assert last[4]["finished"] == "route_deviation"
    assert 0.0 < last[4]["route_completion"] < 100.0


def test_an_episode_that_is_over_is_not_stepped_on(empty):
    run(empty, STAND, seed=0, options={"route": "0"})
    with pytest.raises(gymnasium.error.ResetNeeded, match="over"):
        empty.step(STAND)


def test_terminate_on_ends_an_episode_at_its_first_such_event():
    options = {"suite": "toy", "traffic": 0, "walkers": 0, "observations": GROUPS}
    seed = {"seed": 0, "options": {"route": "0"}}
    kinds = [
        event.kind.name.lower()
        for result in run(RouteEnv(**options), FULL_THROTTLE, **seed)
        for event in result[4]["events"]
    ]
    assert len(kinds) > 1, "the drive must do something wrong before it ends"
    results = run(RouteEnv(terminate_on=(kinds[0],), **options), FULL_THROTTLE, **seed)
    last = [event.kind.name.lower() for event in results[-1][4]["events"]]
    assert last == kinds[: len(last)]  # and nothing before; what `di-1.0` sees of it stands beside
    assert results[-1][2:4] == (True, False)
    assert results[-1][4]["finished"] == ""


# ---- reward


def test_the_reward_is_the_sum_of_its_terms_and_the_return_is_the_driving_score(env):
    results = run(env, FULL_THROTTLE, seed=3)
    for _, reward, _, _, info in results:
        assert reward == sum(info["reward_terms"].values())
    last = results[-1][4]
    score_m = last["driving_score"] / 100.0 * env.plan.length_m
    assert sum(result[1] for result in results) == pytest.approx(score_m, abs=1e-6)


def test_the_score_told_is_the_one_that_the_leaderboard_gives(env):
    from di_envs.rules import rules_named
    from leaderboard.scoring.score import Progress, score_route

    results = run(env, FULL_THROTTLE, seed=3)
    events = [event for result in results for event in result[4]["events"]]
    assert events, "the drive must do something wrong to compare"
    state = env.view.state
    progress = Progress(
        done_m=float(state.route_done_m[0]),
        length_m=env.plan.length_m,
        travelled_m=float(state.outside_done_m[0]),
    )
    score = score_route(events, progress, rules_named("carla-1.0"))
    assert results[-1][4]["driving_score"] == pytest.approx(score.driving_score)
    assert results[-1][4]["route_completion"] == pytest.approx(score.route_completion)
