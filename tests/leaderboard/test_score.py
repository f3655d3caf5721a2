"""Scores by arithmetic that a person can redo, and laws that hold for any events."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis.strategies import booleans, builds, floats, lists, sampled_from

from di_envs.world.state import EventKind
from leaderboard.rules import CARLA_1_0
from leaderboard.score import (
    INFRACTIONS,
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


KINDS = list(EventKind)
EVENTS = builds(Happened, sampled_from(KINDS), floats(0.0, 2000.0))
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
    counts = count_infractions([EventKind.RED_LIGHT, EventKind.COMPLETED, EventKind.RED_LIGHT])
    assert tuple(counts) == INFRACTIONS
    assert counts[EventKind.RED_LIGHT] == 2
    assert sum(counts.values()) == 2


@given(events=lists(EVENTS), extra=EVENTS, progress=PROGRESS)
def test_one_more_infraction_never_raises_the_score(events, extra, progress):
    before = score_route(events, progress, CARLA_1_0)
    after = score_route([*events, extra], progress, CARLA_1_0)
    assert after.driving_score <= before.driving_score
    assert after.route_completion == before.route_completion


@given(events=lists(EVENTS), progress=PROGRESS)
def test_scores_stay_in_their_ranges(events, progress):
    score = score_route(events, progress, CARLA_1_0)
    assert 0.0 <= score.route_completion <= 100.0
    assert 0.0 <= score.infraction_score <= 1.0
    assert 0.0 <= score.driving_score <= score.route_completion


@given(done=floats(0.0, 1000.0), more=floats(0.0, 1000.0))
def test_driving_further_never_lowers_the_completion(done, more):
    near = Progress(done_m=done, length_m=1000.0)
    far = Progress(done_m=done + more, length_m=1000.0)
    assert near.route_completion <= far.route_completion
