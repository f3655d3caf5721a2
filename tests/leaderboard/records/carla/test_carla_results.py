"""The result file that CARLA's Leaderboard would write: its schema to the letter."""

from __future__ import annotations

from dataclasses import replace

import pytest

from di_envs.world.state import EventKind
from leaderboard.records.carla.results import carla_results
from leaderboard.records.record import LOST
from leaderboard.scoring.score import Score
from tests.leaderboard.made_records import RED, event, lost, route, run_of

LABELS = [
    "Avg. driving score",
    "Avg. route completion",
    "Avg. infraction penalty",
    "Collisions with pedestrians",
    "Collisions with vehicles",
    "Collisions with layout",
    "Red lights infractions",
    "Stop sign infractions",
    "Off-road infractions",
    "Route deviations",
    "Route timeouts",
    "Agent blocked",
]


def test_carlas_file_has_carlas_fields_and_no_others():
    content = carla_results(run_of(RED, route(route_id="8", index=1)))
    assert set(content) == {
        "_checkpoint",
        "entry_status",
        "eligible",
        "sensors",
        "values",
        "labels",
    }
    checkpoint = content["_checkpoint"]
    assert set(checkpoint) == {"global_record", "progress", "records"}
    record = checkpoint["records"][0]
    assert set(record) == {"route_id", "index", "status", "infractions", "scores", "meta"}
    assert list(record["infractions"]) == [
        "collisions_pedestrian",
        "collisions_vehicle",
        "collisions_layout",
        "red_light",
        "stop_infraction",
        "outside_route_lanes",
        "route_dev",
        "route_timeout",
        "vehicle_blocked",
    ]
    assert set(record["scores"]) == {"score_route", "score_penalty", "score_composed"}
    assert set(record["meta"]) == {"duration_system", "duration_game", "route_length"}
    assert record["route_id"] == "RouteScenario_7"


def test_carlas_labels_and_values_are_its_twelve_as_strings():
    content = carla_results(run_of(RED, route(route_id="8", index=1)))
    assert content["labels"] == LABELS
    # DS (35 + 100) / 2, RC 75, IS 0.85; one red light and one timeout in half a kilometre each
    assert content["values"] == ["67.500", "75.000", "0.850"] + ["0.000"] * 3 + ["2.000"] + [
        "0.000"
    ] * 3 + ["2.000", "0.000"]
    assert content["_checkpoint"]["progress"] == [2, 2]
    assert content["entry_status"] == "Finished with agent errors"
    assert content["eligible"] is True


def test_carlas_rates_are_sums_over_routes_of_each_routes_own_rate():
    other = replace(RED, route_id="8", index=1, keypoints_m=2000.0)
    infractions = carla_results(run_of(RED, other))["_checkpoint"]["global_record"]["infractions"]
    assert infractions["red_light"] == pytest.approx(1 / 0.5 + 1 / 1.0)


def test_a_route_with_no_completion_adds_nothing_to_carlas_rates():
    none = replace(RED, score=Score(route_completion=0.0, infraction_score=0.7))
    infractions = carla_results(run_of(none))["_checkpoint"]["global_record"]["infractions"]
    assert infractions["red_light"] == 0.0


def test_standard_deviations_are_of_the_sample_and_nan_for_a_single_route():
    two = carla_results(run_of(RED, route(index=1)))["_checkpoint"]["global_record"]
    assert two["scores_std_dev"]["score_route"] == pytest.approx(50.0 / 2**0.5)
    one = carla_results(run_of(RED))["_checkpoint"]["global_record"]
    assert one["scores_std_dev"]["score_route"] == "NaN"


def test_messages_read_as_carlas():
    kinds = {
        EventKind.RED_LIGHT: {"other": 3},
        EventKind.STOP_SIGN: {"other": 4},
        EventKind.COLLISION_VEHICLE: {"other": 5, "other_type": "vehicle.car"},
        EventKind.OUTSIDE_LANES: {"value": 12.5},
        EventKind.ROUTE_DEVIATION: {},
        EventKind.BLOCKED: {},
        EventKind.TIMEOUT: {},
    }
    record = route(events=tuple(event(kind, **fields) for kind, fields in kinds.items()))
    found = carla_results(run_of(record))["_checkpoint"]["records"][0]["infractions"]
    place = "(x=1.235, y=-2.0, z=0.0)"
    assert found["red_light"] == [f"Agent ran a red light 3 at {place}"]
    assert found["stop_infraction"] == [f"Agent ran a stop with id=4 at {place}"]
    assert found["collisions_vehicle"] == [
        f"Agent collided against object with type=vehicle.car and id=5 at {place}"
    ]
    assert found["outside_route_lanes"] == [
        "Agent went outside its route lanes for about 12.5 meters (1.25% of the completed route)"
    ]
    assert found["route_dev"] == [f"Agent deviated from the route at {place}"]
    assert found["vehicle_blocked"] == [f"Agent got blocked at {place}"]
    assert found["route_timeout"] == ["Route timeout."]


def test_the_layout_of_2_x_has_its_fields_rounded_as_there():
    slow = event(EventKind.MIN_SPEED, value=87.654321)
    outside = event(EventKind.OUTSIDE_LANES, value=12.3456)
    first = route(
        score=Score(route_completion=50.0, infraction_score=1 / 3),
        status="Failed - Agent timed out",
        events=(slow, outside, event(EventKind.TIMEOUT)),
        length_m=2000.12345,
        keypoints_m=1.0,
    )
    second = route(index=1, seed=1, status="Perfect", length_m=1000.0)
    content = carla_results(run_of(first, second, rules="carla-2.1"))
    one, two = content["_checkpoint"]["records"]
    assert list(one) == [
        "index",
        "route_id",
        "status",
        "num_infractions",
        "infractions",
        "scores",
        "meta",
    ]
    assert [record["route_id"] for record in (one, two)] == [
        "RouteScenario_7_rep0",
        "RouteScenario_7_rep1",
    ]
    assert set(one["infractions"]) == {
        *carla_results(run_of(RED))["_checkpoint"]["records"][0]["infractions"],
        "min_speed_infractions",
        "yield_emergency_vehicle_infractions",
        "scenario_timeouts",
    }
    assert one["infractions"]["min_speed_infractions"] == [
        "Average speed is 87.65% of the surrounding traffic's one"
    ]
    assert (one["num_infractions"], two["num_infractions"]) == (3, 0)
    assert one["scores"]["score_penalty"] == 0.333333
    assert one["meta"]["route_length"] == 2000.123  # of the dense route
    whole = content["_checkpoint"]["global_record"]
    assert set(whole) == {
        "index",
        "route_id",
        "status",
        "infractions",
        "scores_mean",
        "scores_std_dev",
        "meta",
    }
    assert whole["scores_mean"]["score_route"] == 75.0
    assert whole["status"] == "Failed"
    # two kilometres driven in all; off-road is in kilometres, not a rate
    assert whole["infractions"]["min_speed_infractions"] == 0.5
    assert whole["infractions"]["outside_route_lanes"] == 0.012
    assert content["labels"] == [
        *LABELS,
        "Yield emergency vehicles infractions",
        "Scenario timeouts",
        "Min speed infractions",
    ]
    assert content["values"][0] == str(whole["scores_mean"]["score_composed"])
    assert content["values"][-1] == "0.5"
    assert content["entry_status"] == "Finished"


def test_2_x_counts_routes_that_were_not_driven_as_nought_and_a_single_one_without_deviation():
    half = carla_results(run_of(route(status="Perfect"), planned=2, rules="carla-2.0"))
    assert half["entry_status"] == "Started"
    assert half["_checkpoint"]["global_record"]["scores_mean"]["score_composed"] == 50.0
    one = carla_results(run_of(route(status="Perfect"), rules="carla-2.0"))
    assert one["_checkpoint"]["global_record"]["status"] == "Perfect"
    assert one["_checkpoint"]["global_record"]["scores_std_dev"]["score_route"] == 0
    assert one["eligible"] is True


def test_a_run_cut_short_is_not_eligible_and_says_so():
    content = carla_results(run_of(route(), planned=4))
    assert content["entry_status"] == "Finished with missing data"
    assert content["eligible"] is False
    assert content["_checkpoint"]["progress"] == [1, 4]
    assert carla_results(run_of(planned=4))["entry_status"] == "Started"


@pytest.mark.parametrize("status", sorted(LOST))
def test_a_lost_route_makes_a_run_ineligible_and_is_in_no_mean(status):
    content = carla_results(run_of(route(), lost(status)))
    assert content["entry_status"] == "Crashed"
    assert content["eligible"] is False
    assert content["_checkpoint"]["records"][1]["status"] == "Failed - Simulation crashed"
    assert content["_checkpoint"]["global_record"]["scores"]["score_composed"] == 100.0
