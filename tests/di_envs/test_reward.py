"""The reward's terms, by arithmetic that can be redone on paper."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis.strategies import composite, floats, integers, lists, sampled_from

from di_envs.config import RouteEnvConfig
from di_envs.course import load_course
from di_envs.reward import Standing, infraction_penalty, reward_terms, score_metres
from di_envs.rules import RULES
from di_envs.world.state import EVENT_KINDS, EventKind

PENALTIES = {name: rules.penalties for name, rules in RULES.items()}
RULES_1_0, RULES_2_0, RULES_2_1 = (PENALTIES[f"carla-{name}"] for name in ("1.0", "2.0", "2.1"))
KINDS = RULES_2_0.scored


def standing(done_m=0.0, outside_share=0.0, pace_shares=(), **events):
    counts = [0] * EVENT_KINDS
    counts[EventKind.MIN_SPEED] = len(pace_shares)
    for name, count in events.items():
        counts[EventKind[name.upper()]] = count
    return Standing(done_m, outside_share, tuple(counts), pace_shares)


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


def test_the_reward_takes_what_the_rules_of_that_name_take():
    for name, penalties in PENALTIES.items():
        config = RouteEnvConfig(suite="town05_tiny", route_ids=("0",), rules=name)
        assert load_course(config.changes()).penalties is penalties


def test_an_infraction_in_the_sum_of_2_1_costs_less_the_more_there_were():
    first = reward_terms(standing(100.0), standing(100.0, red_light=1), RULES_2_1)
    assert first["red_light"] == pytest.approx(100.0 / 1.4 - 100.0)
    second = reward_terms(
        standing(100.0, red_light=1), standing(100.0, red_light=1, stop_sign=1), RULES_2_1
    )
    assert second["stop_sign"] == pytest.approx(100.0 / 1.65 - 100.0 / 1.4)


def test_half_the_traffics_pace_at_a_checkpoint_costs_fifteen_percent_in_2_0_and_none_in_1_0():
    before, after = standing(100.0), standing(100.0, pace_shares=(0.5, 1.0, 1.0, 1.0))
    assert reward_terms(before, after, RULES_2_0)["min_speed"] == pytest.approx(-15.0)
    assert reward_terms(before, after, RULES_2_1)["min_speed"] == pytest.approx(100 / 1.2 - 100)
    assert "min_speed" not in reward_terms(before, after, RULES_1_0)
    assert sum(reward_terms(before, after, RULES_1_0).values()) == 0.0


@composite
def episodes(draw):
    """Standings of an episode: progress and counts never go back."""
    steps, done_m, counts, paces = [standing()], 0.0, [0] * EVENT_KINDS, []
    for _ in range(draw(integers(1, 8))):
        done_m += draw(floats(0.0, 20.0))
        for kind in draw(lists(sampled_from(KINDS), max_size=2)):
            counts[kind] += 1
            if kind == EventKind.MIN_SPEED:
                paces.append(draw(floats(0.0, 0.999)))
        steps.append(Standing(done_m, draw(floats(0.0, 1.0)), tuple(counts), tuple(paces)))
    return steps


@given(episodes(), sampled_from(list(PENALTIES.values())))
def test_an_episodes_return_is_its_driving_score_in_metres(steps, penalties):
    rewards = [
        sum(reward_terms(before, after, penalties).values())
        for before, after in itertools.pairwise(steps)
    ]
    assert math.fsum(rewards) == pytest.approx(score_metres(steps[-1], penalties), abs=1e-9)


COSTS = [(kind, penalties) for penalties in PENALTIES.values() for kind in penalties.costs]


@given(episodes(), sampled_from(COSTS))
def test_one_more_infraction_never_raises_the_score(steps, cost):
    kind, penalties = cost
    counts = list(steps[-1].counts)
    counts[kind] += 1
    worse = steps[-1]._replace(counts=tuple(counts))
    assert score_metres(worse, penalties) <= score_metres(steps[-1], penalties)
    assert infraction_penalty(worse, penalties) < infraction_penalty(steps[-1], penalties)
