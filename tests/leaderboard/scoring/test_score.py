"""Scores by arithmetic that a person can redo, and laws that hold for any events."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis.strategies import (
    booleans,
    builds,
    floats,
    lists,
    one_of,
    permutations,
    sampled_from,
)

from di_envs.rules import CARLA_1_0, CARLA_2_0, CARLA_2_1, DI_1_0, RULES
from di_envs.world.state import EventKind
from leaderboard.scoring.score import (
    Progress,
    Score,
    count_infractions,
    infractions_per_km,
    mean_score,
    score_route,
)


@dataclass(frozen=True)
class Happened:
    kind: EventKind
    value: float = 0.0


OTHERS = [kind for kind in EventKind if kind != EventKind.MIN_SPEED]
EVENTS = one_of(
    builds(Happened, sampled_from(OTHERS), floats(0.0, 2000.0)),
    builds(Happened, sampled_from([EventKind.MIN_SPEED]), floats(0.0, 100.0)),
)
ANY_RULES = sampled_from(list(RULES.values()))
PROGRESS = builds(
    Progress,
    done_m=floats(0.0, 1500.0),
    length_m=floats(1.0, 1500.0),
    completed=booleans(),
)
FINISHED = Progress(done_m=995.0, length_m=1000.0, completed=True)


def test_a_faultless_completed_route_scores_a_hundred():
    score = score_route([Happened(EventKind.COMPLETED)], FINISHED, CARLA_1_0)
    assert (score.route_completion, score.infraction_score, score.driving_score) == (100, 1, 100)


def test_two_red_lights_and_a_car_hit_multiply():
    events = [Happened(EventKind.RED_LIGHT)] * 2 + [Happened(EventKind.COLLISION_VEHICLE)]
    score = score_route(events, FINISHED, CARLA_1_0)
    assert score.driving_score == pytest.approx(100 * 0.7 * 0.7 * 0.6)


def test_a_timeout_at_half_the_route_scores_fifty():
    half = Progress(done_m=500.0, length_m=1000.0)
    assert score_route([Happened(EventKind.TIMEOUT)], half, CARLA_1_0).driving_score == 50.0


def test_fifty_of_five_hundred_metres_outside_lanes_cost_ten_percent_and_no_completion():
    half = Progress(done_m=500.0, length_m=1000.0)
    score = score_route([Happened(EventKind.OUTSIDE_LANES, 50.0)], half, CARLA_1_0)
    assert score.route_completion == 50.0
    assert score.infraction_score == pytest.approx(0.9)


def test_metres_outside_lanes_are_a_share_of_the_metres_over_which_they_were_counted():
    progress = Progress(done_m=500.0, length_m=1000.0, travelled_m=200.0)
    score = score_route([Happened(EventKind.OUTSIDE_LANES, 50.0)], progress, CARLA_1_0)
    assert score.infraction_score == pytest.approx(0.75)


def test_more_metres_outside_than_were_driven_cost_everything_but_never_go_below_zero():
    progress = Progress(done_m=10.0, length_m=1000.0)
    score = score_route([Happened(EventKind.OUTSIDE_LANES, 50.0)], progress, CARLA_1_0)
    assert score.driving_score == 0.0


def test_a_benchmark_is_the_mean_of_products_and_not_the_product_of_means():
    scores = [
        Score(route_completion=100.0, infraction_score=0.5),
        Score(route_completion=50.0, infraction_score=1.0),
    ]
    driving, completion, penalty = mean_score(scores)
    assert (driving, completion, penalty) == (50.0, 75.0, 0.75)
    assert driving != completion * penalty


def test_the_mean_of_no_scores_is_refused():
    with pytest.raises(ValueError, match="no route was driven"):
        mean_score([])


def test_three_infractions_in_two_kilometres_are_one_and_a_half_per_kilometre():
    assert infractions_per_km(3, 2000.0) == 1.5
    assert infractions_per_km(3, 0.0) == 0.0


def test_infractions_are_counted_in_carlas_order_with_zeros():
    kinds = [EventKind.RED_LIGHT, EventKind.COMPLETED, EventKind.RED_LIGHT, EventKind.MIN_SPEED]
    counts = count_infractions(kinds, CARLA_1_0)
    assert [kind.name.lower() for kind in counts] == [
        "collision_walker",
        "collision_vehicle",
        "collision_static",
        "red_light",
        "stop_sign",
        "outside_lanes",
        "route_deviation",
        "timeout",
        "blocked",
    ]
    assert counts[EventKind.RED_LIGHT] == 2
    assert sum(counts.values()) == 2
    assert count_infractions(kinds, CARLA_2_0)[EventKind.MIN_SPEED] == 1


# (events, done of 1000 m, IS under 1.0, 2.0 and 2.1), worked by hand
WORKED = [
    ([], 1000.0, 1.0, 1.0, 1.0),
    ([(EventKind.COLLISION_WALKER, 0)], 1000.0, 0.5, 0.5, 1 / 2),
    ([(EventKind.COLLISION_VEHICLE, 0)], 1000.0, 0.6, 0.6, 1 / 1.7),
    ([(EventKind.COLLISION_STATIC, 0)], 1000.0, 0.65, 0.65, 1 / 1.6),
    ([(EventKind.RED_LIGHT, 0)], 1000.0, 0.7, 0.7, 1 / 1.4),
    ([(EventKind.STOP_SIGN, 0)], 1000.0, 0.8, 0.8, 1 / 1.25),
    # two red lights and a car: 0.49 x 0.6; 1 + 0.4 + 0.4 + 0.7 = 2.5
    (
        [(EventKind.RED_LIGHT, 0)] * 2 + [(EventKind.COLLISION_VEHICLE, 0)],
        1000.0,
        *[0.294] * 2,
        0.4,
    ),
    # at half the traffic's pace: 1 - 0.3 x 0.5; 1 + 0.4 x 0.5
    ([(EventKind.MIN_SPEED, 50.0)], 1000.0, 1.0, 0.85, 1 / 1.2),
    # standing at two checkpoints: 0.7 x 0.7; 1 + 0.4 + 0.4
    ([(EventKind.MIN_SPEED, 0.0)] * 2, 1000.0, 1.0, 0.49, 1 / 1.8),
    # 50 of 500 m outside: x 0.9, in 2.1 beside the sum
    ([(EventKind.OUTSIDE_LANES, 50.0)], 500.0, 0.9, 0.9, 0.9),
    ([(EventKind.OUTSIDE_LANES, 50.0), (EventKind.RED_LIGHT, 0)], 500.0, *[0.63] * 2, 0.9 / 1.4),
    # what ends a route, and scenarios, cost nothing
    ([(EventKind.TIMEOUT, 0), (EventKind.SCENARIO, 3)], 500.0, 1.0, 1.0, 1.0),
]


@pytest.mark.parametrize(("events", "done_m", "one", "two", "two_one"), WORKED)
def test_scores_are_those_worked_by_hand(events, done_m, one, two, two_one):
    progress = Progress(done_m=done_m, length_m=1000.0)
    happened = [Happened(kind, value) for kind, value in events]
    for rules, expected in ((CARLA_1_0, one), (CARLA_2_0, two), (CARLA_2_1, two_one)):
        score = score_route(happened, progress, rules)
        assert score.infraction_score == pytest.approx(expected, abs=1e-12)
        assert score.driving_score == pytest.approx(done_m / 10.0 * expected, abs=1e-9)


def test_one_drive_scores_by_each_rule_set_from_what_that_one_sees():
    """A walker hit, again after five seconds, and a red light passed at the lane's edge."""
    events = [
        Happened(EventKind.COLLISION_WALKER),
        Happened(EventKind.FIRST_HIT_WALKER),
        Happened(EventKind.COLLISION_WALKER),
        Happened(EventKind.RED_LIGHT_WIDE),
    ]
    assert score_route(events, FINISHED, CARLA_1_0).driving_score == pytest.approx(25.0)
    assert score_route(events, FINISHED, DI_1_0).driving_score == pytest.approx(35.0)
    assert count_infractions([e.kind for e in events], CARLA_1_0)[EventKind.RED_LIGHT] == 0
    assert count_infractions([e.kind for e in events], DI_1_0)[EventKind.FIRST_HIT_WALKER] == 1


def test_rules_2_round_the_completion_to_two_decimals():
    progress = Progress(done_m=123.456, length_m=1000.0)
    assert score_route([], progress, CARLA_1_0).route_completion == pytest.approx(12.3456)
    assert score_route([], progress, CARLA_2_0).route_completion == 12.35


@given(events=lists(EVENTS, max_size=8).flatmap(lambda e: permutations(e).map(lambda p: (e, p))))
def test_the_order_of_events_does_not_change_a_bit(events):
    one, other = events
    for rules in RULES.values():
        assert score_route(one, FINISHED, rules) == score_route(other, FINISHED, rules)


def test_an_event_that_the_rules_do_not_know_is_refused():
    with pytest.raises(ValueError, match="do not say what the event 77 costs"):
        score_route([Happened(77)], FINISHED, CARLA_1_0)  # type: ignore[arg-type]


@given(events=lists(EVENTS), extra=EVENTS, progress=PROGRESS, rules=ANY_RULES)
def test_one_more_infraction_never_raises_the_score(events, extra, progress, rules):
    before = score_route(events, progress, rules)
    after = score_route([*events, extra], progress, rules)
    assert after.driving_score <= before.driving_score
    assert after.route_completion == before.route_completion


@given(events=lists(EVENTS), progress=PROGRESS, rules=ANY_RULES)
def test_scores_stay_in_their_ranges(events, progress, rules):
    score = score_route(events, progress, rules)
    assert 0.0 <= score.route_completion <= 100.0
    assert 0.0 <= score.infraction_score <= 1.0
    assert 0.0 <= score.driving_score <= score.route_completion


@given(done=floats(0.0, 1000.0), more=floats(0.0, 1000.0))
def test_driving_further_never_lowers_the_completion(done, more):
    near = Progress(done_m=done, length_m=1000.0)
    far = Progress(done_m=done + more, length_m=1000.0)
    assert near.route_completion(2) <= far.route_completion(2)
    assert near.route_completion() <= far.route_completion()
