"""A run over a file of which routes are refused: said in its record, its table, CARLA's results."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from rich.console import Console

from di_envs.suites import choose_suite
from leaderboard.commands.cli import main
from leaderboard.commands.ending import EXIT_USAGE
from leaderboard.records.carla.results import carla_results
from leaderboard.records.record import NOT_PLANNED
from leaderboard.records.results import CARLA_FILE, read_run
from leaderboard.replaying.replay import replay_env
from leaderboard.replaying.verify import verify_route
from leaderboard.running.jobs import RunSpec
from leaderboard.running.runner import evaluate
from leaderboard.tables.run_tables import run_tables
from tests.leaderboard.made_records import route, run_of

WHY = "Route 'far': keypoint 0 is 99 m from a lane; at most 60 m is allowed. Move it."
MIXED = """<routes>
<route id="good" town="toy"><weather id="WetNoon"/>
<waypoint x="-60" y="55.25" z="0"/><waypoint x="-20" y="55.25" z="0"/></route>
<route id="far" town="toy"><waypoint x="900" y="0" z="0"/><waypoint x="-20" y="55" z="0"/></route>
</routes>"""


def printed(run: object) -> str:
    out = io.StringIO()
    Console(file=out, width=160).print(run_tables(run))  # type: ignore[arg-type]
    return out.getvalue()


@pytest.mark.parametrize("rules", ["carla-1.0", "carla-2.1"])
def test_a_refused_route_stands_in_the_results_and_in_no_mean(rules: str) -> None:
    routes = (route("1", score=route().score), route("1", seed=1, index=1))
    whole = carla_results(run_of(*routes, rules=rules))
    partly = carla_results(run_of(*routes, rules=rules, refused={"far": WHY}))
    assert partly["values"] == whole["values"]
    records = partly["_checkpoint"]["records"]
    assert [record["index"] for record in records] == [0, 1, 2, 3]
    assert [record["status"] for record in records[2:]] == [NOT_PLANNED] * 2
    assert partly["_checkpoint"]["progress"] == [4, 4]
    assert whole["eligible"]
    assert not partly["eligible"]
    assert partly["entry_status"] != "Finished"


def test_the_table_has_a_row_for_it_and_says_how_many_of_how_many() -> None:
    table = printed(run_of(route("1"), refused={"far": WHY}, notes=("Traffic: 3 vehicles.",)))
    assert "could not be planned: keypoint 0 is 99 m from a lane" in table
    assert "1 of 2 routes, which could not be planned" in table
    assert "Traffic: 3 vehicles." in table


@pytest.mark.filterwarnings("ignore:mixed.xml. 1 of 2 routes cannot be planned:UserWarning")
def test_a_run_drives_the_others_and_its_record_says_what_was_refused_and_seen(
    tmp_path: Path,
) -> None:
    path = tmp_path / "mixed.xml"
    path.write_text(MIXED, encoding="utf-8")
    options = {"town": "toy", "routes": str(path), "traffic": 0, "walkers": 0}
    evaluate(
        RunSpec(agent="expert", options=options),
        [0],
        suite=choose_suite(town="toy", routes=path),
        folder=tmp_path / "run",
        console=Console(file=io.StringIO()),
    )
    run = read_run(tmp_path / "run")
    (record,) = run.routes
    assert (record.route_id, record.weather, run.planned) == ("good", "0 %: WetNoon", 1)
    assert "is 794.8 m from" in run.refused["far"]
    assert any("1 of 2 routes cannot be planned" in note for note in run.notes)
    results = json.loads((tmp_path / "run" / CARLA_FILE).read_text(encoding="utf-8"))
    statuses = [each["status"] for each in results["_checkpoint"]["records"]]
    assert statuses == ["Completed", NOT_PLANNED]
    env = replay_env(run)
    assert verify_route(run, record, env).problems == ()
    env.close()


def test_strict_refuses_the_file_and_a_refused_route_alone_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mixed.xml"
    path.write_text(MIXED, encoding="utf-8")
    mixed = ["--agent", "expert", "--town", "toy", "--routes", str(path)]
    assert main(["drive", *mixed, "--strict", "--route", "good"]) == EXIT_USAGE
    assert main(["drive", *mixed, "--route", "far"]) == EXIT_USAGE
    output = ["--output", str(tmp_path / "out")]
    assert main(["evaluate", *mixed, *output, "--strict"]) == EXIT_USAGE
    assert capsys.readouterr().err.count("Route 'far': keypoint 0") == 3
