"""Our result files: without loss, never half a file."""

from __future__ import annotations

import json
import os
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis.strategies import floats, sampled_from

from di_envs.world.state import EventKind
from leaderboard.records.own_files import prepare_folder, take_away
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
from tests.leaderboard.made_records import RED, event, route, run_of


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


def test_the_fingerprint_leaves_out_the_clock_and_nothing_else():
    assert route(wall_s=1.0).fingerprint() == route(wall_s=2.0).fingerprint()
    assert route(observation_hash="xx").fingerprint() != route().fingerprint()
    assert route(done_m=999.0).fingerprint() != route().fingerprint()
