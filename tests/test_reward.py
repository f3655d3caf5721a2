"""The reward's terms, by arithmetic that can be redone on paper."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis.strategies import composite, floats, integers, lists, sampled_from

from di_envs.reward import PENALTIES, Standing, infraction_penalty, reward_terms, score_metres
from di_envs.world.state import EventKind
from leaderboard.rules import RULES

RULES_1_0 = PENALTIES["carla-1.0"]


def standing(done_m=0.0, outside_share=0.0, **events):
    counts = [0] * 12
    for name, count in events.items():
        counts[EventKind[name.upper()]] = count
    return Standing(done_m, outside_share, tuple(counts))


def test_ten_metres_without_an_infraction_earn_ten():
    terms = reward_terms(standing(30.0), standing(40.0), RULES_1_0)
    assert terms["progress"] == 10.0
    assert sum(terms.values()) == 10.0


def test_progress_after_a_red_light_earns_seventy_per_cent():
    terms = reward_terms(standing(30.0, red_light=1), standing(40.0, red_light=1), RULES_1_0)
    assert terms["progress"] == pytest.approx(7.0)
    assert sum(terms.values()) == pytest.approx(7.0)


def test_hitting_a_walker_at_forty_metres_costs_half_of_them():
    terms = reward_terms(standing(40.0), standing(40.0, collision_walker=1), RULES_1_0)
    assert terms["collision_walker"] == -20.0
    assert sum(terms.values()) == -20.0


def test_two_infractions_in_one_step_are_charged_one_after_the_other():
    after = standing(100.0, collision_vehicle=1, stop_sign=1)
    terms = reward_terms(standing(100.0), after, RULES_1_0)
    assert terms["collision_vehicle"] == pytest.approx(-40.0)  # 100 becomes 60
    assert terms["stop_sign"] == pytest.approx(-12.0)  # 60 becomes 48


def test_a_tenth_outside_the_lanes_takes_a_tenth_of_the_metres():
    terms = reward_terms(standing(40.0), standing(50.0, 0.1), RULES_1_0)
    assert terms["progress"] == 10.0
    assert terms["outside_lanes"] == pytest.approx(-5.0)


def test_the_terms_are_named_after_the_events():
    assert list(reward_terms(standing(), standing(), RULES_1_0)) == [
        "progress",
        "outside_lanes",
        "collision_walker",
        "collision_vehicle",
        "collision_static",
        "red_light",
        "stop_sign",
    ]


def test_the_penalties_are_those_that_the_leaderboard_scores_by():
    assert {name: dict(rules.factors) for name, rules in RULES.items()} == {
        name: dict(factors) for name, factors in PENALTIES.items()
    }


@composite
def episodes(draw):
    """Standings of an episode: progress and counts never go back."""
    steps, done_m, counts = [standing()], 0.0, [0] * 12
    for _ in range(draw(integers(1, 8))):
        done_m += draw(floats(0.0, 20.0))
        for kind in draw(lists(sampled_from(list(RULES_1_0)), max_size=2)):
            counts[kind] += 1
        steps.append(Standing(done_m, draw(floats(0.0, 1.0)), tuple(counts)))
    return steps


@given(episodes())
def test_an_episodes_return_is_its_driving_score_in_metres(steps):
    rewards = [
        sum(reward_terms(before, after, RULES_1_0).values())
        for before, after in itertools.pairwise(steps)
    ]
    assert math.fsum(rewards) == pytest.approx(score_metres(steps[-1], RULES_1_0), abs=1e-9)


@given(episodes(), sampled_from(list(RULES_1_0)))
def test_one_more_infraction_never_raises_the_score(steps, kind):
    counts = list(steps[-1].counts)
    counts[kind] += 1
    worse = steps[-1]._replace(counts=tuple(counts))
    assert score_metres(worse, RULES_1_0) <= score_metres(steps[-1], RULES_1_0)
    assert infraction_penalty(worse, RULES_1_0) < infraction_penalty(steps[-1], RULES_1_0)
