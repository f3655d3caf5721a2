"""Result files: CARLA's schema to the letter, ours without loss, never half a file."""

from __future__ import annotations

import io
import json
import os
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis.strategies import floats, sampled_from
from rich.console import Console

from di_envs.world.state import EventKind
from leaderboard.records.carla.results import carla_results
from leaderboard.records.own_files import prepare_folder, take_away
from leaderboard.records.record import LOST, RouteRecord, RunRecord
from leaderboard.records.results import (
    CARLA_FILE,
    RECORD_FILE,
    DamagedError,
    ResultsError,
    add_route,
    read_run,
    start_run,
    write_run,
)
from leaderboard.records.run_json import route_from_json, route_to_json, run_from_json, run_to_json
from leaderboard.scoring.score import Score
from leaderboard.tables.run_tables import driving_interval, run_tables
from tests.leaderboard.made_records import event, route, run_of

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


RED = route(
    score=Score(route_completion=50.0, infraction_score=0.7),
    status="Failed - Agent timed out",
    done_m=500.0,
    events=(event(EventKind.RED_LIGHT, other=3), event(EventKind.TIMEOUT)),
)


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


LOST_SCORE = Score(route_completion=0.0, infraction_score=1.0)


def lost(status: str) -> RouteRecord:
    reason = "the worker was killed by SIGKILL"
    return route("8", index=1, status=status, reason=reason, score=LOST_SCORE, done_m=0.0)


@pytest.mark.parametrize("status", sorted(LOST))
def test_a_lost_route_makes_a_run_ineligible_and_is_in_no_mean(status):
    content = carla_results(run_of(route(), lost(status)))
    assert content["entry_status"] == "Crashed"
    assert content["eligible"] is False
    assert content["_checkpoint"]["records"][1]["status"] == "Failed - Simulation crashed"
    assert content["_checkpoint"]["global_record"]["scores"]["score_composed"] == 100.0


@pytest.mark.parametrize("status", sorted(LOST))
def test_a_lost_route_stands_apart_in_the_table(status):
    run = run_of(route(), lost(status))
    text = _text(run)
    assert f"1 lost ({status.removeprefix('Failed - ')})" in text
    assert "Left out of every mean: 1 of 2 routes x seeds" in text
    assert driving_interval(run).mean == 100.0
    assert "--resume" in _text(run_of(lost(status)))


@given(sampled_from(list(EventKind)), floats(0.0, 1e4), floats(-1e4, 1e4))
def test_a_run_comes_back_from_its_file_as_it_was(kind, value, x):
    run = run_of(route(events=(event(kind, value=value, x=x),)), route(index=1, bound=None))
    head = run_from_json(json.loads(json.dumps(run_to_json(run))))
    routes = tuple(
        route_from_json(json.loads(json.dumps(route_to_json(record)))) for record in run.routes
    )
    assert replace(head, routes=routes) == run


def test_files_are_written_whole_and_leave_no_scratch_behind(tmp_path):
    write_run(tmp_path, run_of(RED))
    write_run(tmp_path, run_of(RED, route(route_id="8", index=1)))
    assert sorted(os.listdir(tmp_path)) == [RECORD_FILE, CARLA_FILE, "routes"]
    assert sorted(os.listdir(tmp_path / "routes")) == ["0000.json", "0001.json"]
    assert len(read_run(tmp_path).routes) == 2


def test_the_table_of_a_long_run_is_written_ever_more_rarely_and_lacks_few_routes(tmp_path):
    records = tuple(route(route_id=str(index), index=index) for index in range(120))
    run, tables = replace(run_of(), planned=120), set()
    (tmp_path / "routes").mkdir()
    start_run(tmp_path, run)
    for done in range(1, 121):
        add_route(tmp_path, replace(run, routes=records[:done]), records[done - 1])
        table = json.loads((tmp_path / CARLA_FILE).read_text())
        shown = len(table["_checkpoint"]["records"])
        assert done - done // 16 <= shown <= done
        tables.add(shown)
    assert set(range(1, 32)) <= tables
    assert len(tables) < 70
    assert len(read_run(tmp_path).routes) == 120


def test_half_a_file_is_named_as_such(tmp_path):
    write_run(tmp_path, run_of(RED))
    path = tmp_path / RECORD_FILE
    path.write_text(path.read_text()[:100])
    with pytest.raises(ResultsError, match="is not whole JSON"):
        read_run(tmp_path)


@pytest.mark.parametrize("content", ["[]", "{}", '{"format": "other"}'])
def test_a_foreign_file_is_named_as_such(tmp_path, content):
    (tmp_path / RECORD_FILE).write_text(content)
    with pytest.raises(
        ResultsError, match=r"driveinsight\.json: .*its format is not 'driveinsight-run'"
    ):
        read_run(tmp_path)


def test_a_file_of_another_version_or_without_a_field_is_refused(tmp_path):
    content = run_to_json(run_of(RED))
    (tmp_path / RECORD_FILE).write_text(json.dumps({**content, "format_version": 99}))
    with pytest.raises(ResultsError, match="format version 99"):
        read_run(tmp_path)
    del content["cpu"]
    (tmp_path / RECORD_FILE).write_text(json.dumps(content))
    with pytest.raises(ResultsError, match=r"driveinsight\.json: cpu: is missing"):
        read_run(tmp_path)


@pytest.mark.parametrize(
    ("find", "put", "said"),
    [
        ('"game_s": 200.0', '"game_s": "200"', "game_s: expected a number, got '200'"),
        ('"steps": 2000', '"steps": true', "steps: expected a whole number, got true"),
        ('"infraction_score":0.7', '"infraction_score":NaN', "NaN is no number"),
        (
            '"red_light"',
            '"blue_light"',
            r"events\[0\]\.kind: unknown 'blue_light'; did you mean 'red_light'",
        ),
        (' "steps": 2000,\n', "", "0000.json: steps: is missing"),
        ('"tick":40', '"tick":"40"', r"events\[0\]\.tick: expected a whole number, got '40'"),
        ('"format_version": 3', '"format_version": 2', "format version 2, this program reads 3"),
        ('"driveinsight-route"', '"driveinsight-run"', "its format is not 'driveinsight-route'"),
        ('"index": 0', '"index": 7', "it was renamed"),
        ('"steps": 2000', '"step": 1, "steps": 2000', "field 'step'; did you mean 'steps'"),
        (
            '"infraction_score":0.7',
            '"infraction_scor":0.7',
            "score: unknown field 'infraction_scor'",
        ),
        (
            '"infraction_score":0.7',
            '"infraction_score":[7]',
            "score.infraction_score: expected a num",
        ),
        (
            '"infraction_score":0.7',
            '"infraction_score":0.8',
            "score.driving_score: 35.0 is not the product",
        ),
        ('"infraction_score":0.7', '"infraction_score":1e999', "1e999 is too large a number"),
        ('"tick":40', '"tick":18446744073709551616', "is too large a whole number"),
    ],
)
def test_a_garbled_route_is_refused_with_what_is_wrong(tmp_path, find, put, said):
    write_run(tmp_path, run_of(RED))
    path = tmp_path / "routes" / "0000.json"
    text = path.read_text()
    assert find in text
    path.write_text(text.replace(find, put))
    with pytest.raises(ResultsError, match=said):
        read_run(tmp_path)


@pytest.mark.parametrize("absurd", ["[" * 100_000, '{"a":' * 100_000, "9" * 100_000], ids=len)
def test_an_absurd_route_is_refused_in_one_line(tmp_path, absurd):
    write_run(tmp_path, run_of(RED))
    path = tmp_path / "routes" / "0000.json"
    path.write_text(path.read_text().replace('"steps": 2000', f'"steps": {absurd}'))
    with pytest.raises(DamagedError) as caught:
        read_run(tmp_path)
    said = str(caught.value)
    assert said.startswith(f"{path}: is ")
    assert "\n" not in said
    assert len(said) < len(str(path)) + 250


def test_routes_inside_the_runs_own_file_are_refused(tmp_path):
    content = {**run_to_json(run_of(RED)), "routes": []}
    write_run(tmp_path, run_of(RED))
    (tmp_path / RECORD_FILE).write_text(json.dumps(content))
    with pytest.raises(DamagedError, match="unknown field 'routes'; each has a file of its own"):
        read_run(tmp_path)


def test_routes_of_another_run_are_refused(tmp_path):
    write_run(tmp_path / "a", run_of(RED))
    write_run(tmp_path / "b", run_of(RED, agent="highway"))
    ours, theirs = (tmp_path / name / "routes" / "0000.json" for name in "ab")
    ours.write_text(theirs.read_text())
    with pytest.raises(ResultsError, match="belongs to another run"):
        read_run(tmp_path / "a")


def test_overwriting_takes_all_routes_of_the_earlier_run_away(tmp_path):
    write_run(tmp_path, run_of(RED, route(route_id="8", index=1)))
    prepare_folder(tmp_path, overwrite=True)
    take_away(tmp_path)
    write_run(tmp_path, run_of(RED, agent="highway"))
    assert len(read_run(tmp_path).routes) == 1


def test_a_missing_folder_is_answered_with_where_results_come_from(tmp_path):
    with pytest.raises(ResultsError, match="evaluate --output"):
        read_run(tmp_path / "nothing")


def test_results_are_not_overwritten_unless_asked(tmp_path):
    write_run(tmp_path, run_of(RED))
    with pytest.raises(ResultsError, match="--overwrite"):
        prepare_folder(tmp_path)
    prepare_folder(tmp_path, overwrite=True)


def test_a_folder_that_cannot_be_made_is_refused_before_any_work(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultsError, match="choose another --output"):
        prepare_folder(tmp_path / "file" / "results")


def _text(run: RunRecord) -> str:
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(run_tables(run))
    return console.export_text()


def test_the_table_shows_scores_bound_track_and_what_happened():
    text = _text(run_of(RED, seeds=(0,)))
    assert "expert on town05_long · track PRIVILEGED · rules carla-1.0" in text
    row = next(line for line in text.splitlines() if line.startswith("│ 7 "))
    assert [cell.strip() for cell in row.strip("│").split("│")] == [
        "7",
        "35.0",
        "50.0",
        "0.70",
        "100.0",
        "2.00",
        "1 red light, 1 timeout",
    ]
    assert "one seed (0): no confidence interval" in text
    assert "DS under di-1.0 is not known" in text


def test_the_table_has_the_score_by_our_rules_beside_that_by_carla_s():
    twice = [event(EventKind.COLLISION_VEHICLE)] * 2 + [event(EventKind.FIRST_HIT_VEHICLE)]
    hit = route(score=Score(route_completion=100.0, infraction_score=0.36), events=tuple(twice))
    text = _text(run_of(hit, seeds=(0,), versions={"world": "2"}))
    row = next(line for line in text.splitlines() if line.startswith("│ 7 "))
    assert [cell.strip() for cell in row.strip("│").split("│")][1:3] == ["36.0", "60.0"]
    assert "is not known" not in text


def test_the_table_counts_the_scenarios_that_began_by_type():
    text = _text(run_of(route(scenarios={"3": 2, "10": 1}), route(index=1, scenarios={"3": 1})))
    rows = [line for line in text.splitlines() if line.startswith(("│ S3 ", "│ S10 "))]
    assert [row.split()[-2] for row in rows] == ["3", "1"]
    assert "scenarios that began" not in _text(run_of(route()))


def test_the_interval_is_over_seed_means():
    routes = [
        route(
            route_id=name,
            seed=seed,
            index=index,
            score=Score(route_completion=completion, infraction_score=1.0),
        )
        for index, (name, seed, completion) in enumerate(
            [("a", 0, 100.0), ("a", 1, 80.0), ("b", 0, 60.0), ("b", 1, 60.0)]
        )
    ]
    interval = driving_interval(run_of(*routes))  # seed means 80 and 70
    assert interval.mean == 75.0
    assert interval.half_width == pytest.approx(12.7062 * 5.0)
    assert "± is the 95 % t-interval of the means of 2 seeds" in _text(run_of(*routes))


def test_a_crash_is_in_the_table_and_an_unfinished_run_says_so():
    crashed = route(status="Failed - Agent crashed", reason="act returned throttle NaN")
    text = _text(run_of(crashed, planned=2))
    assert "1 Agent crashed" in text
    assert "Not complete: 1 of 2" in text
    assert "no route was finished" in _text(run_of(planned=2))


def test_the_fingerprint_leaves_out_the_clock_and_nothing_else():
    assert route(wall_s=1.0).fingerprint() == route(wall_s=2.0).fingerprint()
    assert route(observation_hash="xx").fingerprint() != route().fingerprint()
    assert route(done_m=999.0).fingerprint() != route().fingerprint()
