"""What agents are told of a route: those who are put to the test do not learn what awaits them."""

from __future__ import annotations

import pytest

from agents.base import Requirements
from di_envs.route_env import RouteEnv
from leaderboard.running.driver import Driver
from leaderboard.running.episode import plan_shown
from leaderboard.running.jobs import Job, RunSpec

OPTIONS = {"suite": "toy", "scenarios": "toy", "traffic": 0, "walkers": 0}


@pytest.fixture(scope="module")
def env() -> RouteEnv:
    env = RouteEnv(observations=("prompt",), **OPTIONS)
    env.reset(seed=0, options={"route": "1"})
    return env


def test_only_privileged_agents_learn_where_scenarios_begin(env: RouteEnv) -> None:
    plan = env.plan
    assert len(plan.scenarios) == 3
    privileged = Requirements(observations=("prompt",), privileged=True)
    assert plan_shown(privileged, plan) is plan
    shown = plan_shown(Requirements(observations=("prompt",)), plan)
    assert shown.scenarios == ()
    assert shown.points is plan.points


def test_a_record_says_how_many_scenarios_of_each_type_were_triggered() -> None:
    with Driver(RunSpec(agent="expert", options=OPTIONS, rules="carla-1.0")) as driver:
        record = driver.drive(Job(index=0, route_id="1", seed=0))
    assert dict(record.scenarios) == {"1": 1, "4": 1, "9": 1}
    assert record.status == "Completed"
