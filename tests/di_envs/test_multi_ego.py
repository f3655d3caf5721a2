"""Several egos in one world: PettingZoo's contract, and how the egos bear on each other."""

from __future__ import annotations

import dataclasses
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

import di_envs
from agents import load_agent
from di_envs.multi_ego import MultiEgoEnv
from di_envs.route_env import RouteEnv
from di_envs.routes_apart import START_APART_M
from di_envs.world.state import ActorKind, EventKind

with warnings.catch_warnings():  # its tests import a game of its own in a way it deprecates
    warnings.simplefilter("ignore", DeprecationWarning)
    from pettingzoo.test import parallel_api_test, parallel_seed_test

GO = np.array([0.7, 0.0, 0.0], np.float32)
STAND = np.array([0.0, 0.0, 1.0], np.float32)
GROUPS = ("prompt", "inertial")  # quick: what the egos do does not depend on them
QUIET = {"suite": "toy", "traffic": 0, "walkers": 0, "observations": GROUPS}


@pytest.fixture(scope="module")
def pair():
    return di_envs.parallel_env(2, suite="toy", traffic=6, walkers=3, observations=GROUPS)


def starts(env):
    return np.array([plan.points[0, :3] for plan in env.view.plans])


# ---- PettingZoo's own tests


def test_pettingzoos_api_test_passes_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = di_envs.parallel_env(egos=3, suite="toy", traffic=6, walkers=3, control_dt_s=0.5)
        parallel_api_test(env, num_cycles=120)


def test_pettingzoos_seed_test_passes():
    parallel_seed_test(lambda: di_envs.parallel_env(suite="toy", traffic=6, walkers=3), 20)


# ---- one ego is a RouteEnv


def test_one_ego_alone_is_a_route_env_bit_for_bit():
    options = {"suite": "toy", "observations": GROUPS}
    one, route = MultiEgoEnv(1, **options), RouteEnv(**options)
    for seed in (4, None):
        observations, infos = one.reset(seed=seed)
        assert data_equivalence(
            (observations["ego_0"], infos["ego_0"]), route.reset(seed=seed), exact=True
        )
        over = False
        while not over:
            theirs = route.step(GO)
            ours = tuple(part["ego_0"] for part in one.step({"ego_0": GO}))
            assert data_equivalence(ours, theirs, exact=True)
            over = theirs[2] or theirs[3]
        assert one.agents == []


# ---- routes


def test_drawn_routes_never_start_near_each_other(pair):
    for seed in range(20):
        pair.reset(seed=seed)
        first, second = starts(pair)
        assert np.linalg.norm(first - second) >= START_APART_M


def test_routes_that_start_at_one_place_are_refused():
    env = MultiEgoEnv(2, suite="town05_tiny", traffic=0, walkers=0)
    points = np.array([plan.points[0, :3] for plan in env.plans])
    gaps = np.linalg.norm(points[:, None] - points, axis=2) + 1e9 * np.eye(len(points))
    near = [int(k) for k in np.unravel_index(gaps.argmin(), gaps.shape)]
    with pytest.raises(ValueError, match="start less than 12 m apart"):
        env.reset(seed=1, options={"routes": near})
    far = [int(k) for k in np.unravel_index(np.where(gaps > 1e8, 0, gaps).argmax(), gaps.shape)]
    env.reset(seed=1, options={"routes": far})
    assert [env.plan_of(name).route_id for name in env.agents] == [
        env.plans[k].route_id for k in far
    ]


@pytest.mark.parametrize(
    ("routes", "message"),
    [(["0"], "names 2 routes"), ("01", "names 2 routes"), (["0", "x"], "Unknown route id")],
)
def test_refused_routes_say_what_was_expected(pair, routes, message):
    with pytest.raises(ValueError, match=message):
        pair.reset(seed=1, options={"routes": routes})


def test_more_egos_than_routes_are_refused():
    with pytest.raises(ValueError, match="9 egos need as many routes"):
        MultiEgoEnv(9, **QUIET)
    with pytest.raises(ValueError, match="egos must be at least 1"):
        MultiEgoEnv(0, **QUIET)


# ---- egos bear on each other


def later(plan, points):
    """The same route from a later point on."""
    rows = slice(points, None)
    return dataclasses.replace(
        plan,
        points=plan.points[rows],
        option=plan.option[rows],
        lane=plan.lane[rows],
        lane_m=plan.lane_m[rows],
        route_m=plan.route_m[rows] - plan.route_m[points],
        targets=plan.targets[plan.targets >= points] - points,
    )


def one_behind_the_other(points, **options):
    """Two egos on one route, the second so many points (metres) ahead of the first."""
    env = MultiEgoEnv(2, **QUIET | options)
    env.reset(seed=2)
    plan = env.plan_of("ego_0")
    env.world.reset(2, [plan, later(plan, points)])
    env._start()
    return env


def test_an_ego_sees_the_other_as_a_car_where_it_is():
    env = one_behind_the_other(15)
    seen = env._observe()["ego_0"]["obstacles"][0]
    assert seen[:2] == pytest.approx([15.0, 0.0], abs=0.5)
    assert (seen[7], seen[8]) == (ActorKind.CAR, 1.0)


def test_an_egos_front_camera_shows_the_other_ahead_of_it():
    """Two egos on one road, then the leader off the road: only the follower's picture changes."""
    env = one_behind_the_other(10, observations=("camera",))
    before = env._observe()
    env.world.remove_actor(1)
    after = env._observe()["ego_0"]
    changed = (before["ego_0"]["camera_front"] != after["camera_front"]).any(axis=2)
    rows, columns = np.nonzero(changed)
    assert changed.sum() > 50
    height, width = changed.shape
    assert abs(np.median(columns) - width / 2) < 0.1 * width
    assert np.median(rows) > 0.4 * height
    assert not np.array_equal(before["ego_0"]["camera_front"], before["ego_1"]["camera_front"])


def test_an_ego_that_runs_into_another_counts_a_collision_for_both():
    env = one_behind_the_other(15)
    met = {name: [] for name in env.agents}
    for _ in range(40):
        _, _, _, _, infos = env.step({"ego_0": GO, "ego_1": STAND})
        for name, info in infos.items():
            met[name] += [(event.kind, event.other) for event in info["events"]]
    kinds = (EventKind.FIRST_HIT_VEHICLE, EventKind.COLLISION_VEHICLE)
    assert met["ego_0"] == [(kind, 1) for kind in kinds]
    assert met["ego_1"] == [(kind, 0) for kind in kinds]
    assert env.step({"ego_0": GO, "ego_1": STAND})[4]["ego_1"]["infraction_penalty"] == 0.6


def test_an_ego_whose_route_has_ended_is_seen_once_more_and_then_is_gone():
    env = one_behind_the_other(10, terminate_on=("collision_vehicle",))
    ended = False
    while not ended:
        observations, _, terminated, _, _ = env.step({"ego_0": GO, "ego_1": STAND})
        ended = terminated["ego_0"]
    assert terminated == {"ego_0": True, "ego_1": True}
    assert env.agents == []
    assert observations["ego_0"]["obstacles"][0, 8] == 1.0
    assert (env.view.state.kind[:2] == ActorKind.ABSENT).all()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step({})


def test_the_others_drive_on_through_where_one_has_left():
    env = one_behind_the_other(15)
    env.world.remove_actor(1)
    env.agents.remove("ego_1")
    for _ in range(40):
        observations, _, terminated, truncated, infos = env.step({"ego_0": GO})
        assert infos["ego_0"]["events"] == ()
        assert not observations["ego_0"]["obstacles"][:, 8].any()
    assert set(observations) == set(terminated) == set(truncated) == {"ego_0"}
    assert env.view.state.speed[0] > 5.0


def test_traffic_stops_behind_whichever_ego_stands_in_its_way():
    """Two standing egos, traffic for a minute: nobody drives through either."""
    env = MultiEgoEnv(2, suite="toy", traffic=20, walkers=0, control_dt_s=1.0)
    env.reset(seed=3)
    for _ in range(60):
        _, _, _, _, infos = env.step(dict.fromkeys(env.agents, STAND))
        assert all(info["events"] == () for info in infos.values())
        if len(env.agents) < 2:
            break
    assert int(env.view.state.tick) >= 200


def test_an_expert_for_each_ego_completes_both_routes():
    env = MultiEgoEnv(2, suite="toy", traffic=4, walkers=0)
    observations, infos = env.reset(seed=5)
    experts = {name: load_agent("expert") for name in env.agents}
    memory = {name: agent.start(env.plan_of(name), 5) for name, agent in experts.items()}
    done = {}
    while env.agents:
        actions = {}
        for name in env.agents:
            seen = {**observations[name], "world": env.view_of(name)}
            actions[name], memory[name] = experts[name].act(seen, memory[name])
        observations, _, terminated, truncated, infos = env.step(actions)
        done |= {
            name: info["route_completion"]
            for name, info in infos.items()
            if terminated[name] or truncated[name]
        }
    assert done == pytest.approx({"ego_0": 100.0, "ego_1": 100.0})


# ---- contract


def test_each_ego_must_be_given_an_action_and_nobody_else(pair):
    pair.reset(seed=1)
    with pytest.raises(ValueError, match="an action for each of ego_0, ego_1; got ego_0"):
        pair.step({"ego_0": GO})
    with pytest.raises(ValueError, match="throttle must be in"):
        pair.step({"ego_0": GO, "ego_1": 3.0 * GO})
    assert int(pair.view.state.tick) == 0
    with pytest.raises(ValueError, match="did you mean 'ego_1'"):
        pair.observation_space("ego1")


def test_a_saved_world_of_two_egos_goes_on_with_the_same_bits(pair):
    def ten():
        return [pair.step({"ego_0": GO, "ego_1": STAND}) for _ in range(10)]

    pair.reset(seed=6)
    ten()
    snapshot = di_envs.save(pair)
    first = ten()
    di_envs.restore(pair, snapshot)
    assert data_equivalence(ten(), first, exact=True)
