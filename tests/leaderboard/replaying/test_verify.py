"""A run as it was driven verifies; one altered by a digit, anywhere, does not."""

from __future__ import annotations

import io
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from di_envs.suites import load_suite
from leaderboard.commands.cli import main
from leaderboard.records.packing import pack
from leaderboard.records.results import read_run, write_run, write_table
from leaderboard.replaying.replay import replay_env
from leaderboard.replaying.verify import verify_route, verify_run
from leaderboard.running.jobs import RunSpec
from leaderboard.running.runner import evaluate
from leaderboard.scoring.score import Score

TOY = load_suite("toy")
ROUTE = TOY.specs()[0].route_id
BUSY = {"suite": "toy", "traffic": 8, "walkers": 4, "route_ids": (ROUTE,)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two drives without a look at the road: lanes are left, walls of traffic are hit."""
    folder = tmp_path_factory.mktemp("run")
    spec = RunSpec(agent="constant", options=BUSY, rules="carla-2.1")
    evaluate(spec, [0, 1], suite=TOY, folder=folder, console=Console(file=io.StringIO()))
    return folder


@pytest.fixture(scope="module")
def run(folder):
    return read_run(folder)


@pytest.fixture(scope="module")
def env(run):
    return replay_env(run)


@pytest.mark.parametrize("options", [[], ["--workers", "2"], ["--observations"]])
def test_a_run_as_it_was_driven_stands(folder, options, capsys):
    assert main(["verify", str(folder / "results.json"), *options]) == 0
    shown = capsys.readouterr().out
    assert "The claim stands: DS " in shown
    assert "over 2 routes" in shown
    assert ("observations replayed" in shown) == (options == ["--observations"])


def test_there_is_something_to_verify(run):
    assert any(len(record.events) > 1 for record in run.routes)


def altered_control(record):
    """One digit of one control: the last bit of the steering of the fourth decision."""
    controls = record.control_array().copy()
    controls[3, 1] = np.nextafter(controls[3, 1], np.float32(1.0))
    return {"controls": pack(controls, "<f4")}


ALTERED = {
    "score": lambda r: {
        "score": replace(r.score, infraction_score=r.score.infraction_score + 0.01)
    },
    "completion": lambda r: {
        "score": Score(
            route_completion=r.score.route_completion + 0.01,
            infraction_score=r.score.infraction_score,
        )
    },
    "event's place": lambda r: {
        "events": (replace(r.events[0], x=r.events[0].x + 0.001), *r.events[1:])
    },
    "event left out": lambda r: {"events": r.events[1:]},
    "control": altered_control,
    "trace": lambda r: {"trace": (*r.trace[:2], (1.0, 0.0, 0.0, 0.0, 0.0, 0.0), *r.trace[3:])},
    "metres done": lambda r: {"done_m": r.done_m + 0.001},
    "status": lambda r: {"status": "Perfect"},
    "an agent's fault instead of the end": lambda r: {"status": "Failed - Agent crashed"},
    "bound": lambda r: {"bound": replace(r.bound, route_completion=50.0)},
    "hash": lambda r: {"reward_hash": "0" + r.reward_hash[1:]},
    "cut short": lambda r: {
        "controls": pack(r.control_array()[:-1], "<f4"),
        "steps": r.steps - 1,
    },
    "seed": lambda r: {"seed": r.seed + 1},
    "checks of observations": lambda r: {
        "observation_checks": r.observation_checks[:40]
        + ("0" if r.observation_checks[40] != "0" else "1")
        + r.observation_checks[41:]
    },
}


@pytest.mark.parametrize("name", ALTERED)
def test_one_altered_digit_is_found(run, env, name):
    record = run.routes[0]
    assert verify_route(run, record, env).stands
    verdict = verify_route(run, replace(record, **ALTERED[name](record)), env)
    assert not verdict.stands
    assert verdict.problems


def test_what_differs_is_named(run, env):
    record = run.routes[0]
    moved = replace(record.events[0], x=record.events[0].x + 0.001)
    claim = replace(record, events=(moved, *record.events[1:]))
    (problem,) = verify_route(run, claim, env).problems
    assert "event 0" in problem
    assert f".x: claimed {moved.x}" in problem


def test_a_route_that_the_agent_failed_half_way_can_be_verified(run, env):
    """Its controls end before the route does, and that is what the status says."""
    from leaderboard.replaying.verify import replayed_record

    record = run.routes[0]
    cut = replace(
        record,
        status="Failed - Agent crashed",
        reason="KeyError",
        controls=pack(record.control_array()[:20], "<f4"),
        steps=20,
    )
    claim = replayed_record(run, cut, env)
    assert claim.game_s == 2.0
    assert claim.score.route_completion < record.score.route_completion
    assert verify_route(run, claim, env).stands


@pytest.mark.parametrize("name", ["FailsAtStart", "Raises", "ReturnsNan"])
def test_what_an_agent_had_driven_before_it_failed_can_be_verified(name, tmp_path, capsys):
    agent = f"{Path(__file__).parents[1] / 'misbehaving.py'}:{name}"
    spec = RunSpec(agent=agent, options={**BUSY, "traffic": 0, "walkers": 0})
    run = evaluate(spec, [0], suite=TOY, folder=tmp_path, console=Console(file=io.StringIO()))
    assert run.routes[0].reason
    assert main(["verify", str(tmp_path), "--observations"]) == 0
    assert "The claim stands" in capsys.readouterr().out


def test_a_lost_route_claims_nothing(run, folder, tmp_path):
    lost = replace(run.routes[1], status="Failed - Worker died", reason="killed", controls="")
    write_run(tmp_path, replace(run, routes=(run.routes[0], lost)))
    assert verify_run(read_run(tmp_path), tmp_path).stands


def test_observations_are_compared_when_asked_for(run, folder, tmp_path):
    checks = run.routes[0].check_array().copy()
    checks[5] += 1
    claim = replace(run.routes[0], observation_checks=pack(checks, "<u4"))
    write_run(tmp_path, replace(run, routes=(claim, run.routes[1])))
    assert verify_run(run, tmp_path).stands
    verdict = verify_run(read_run(tmp_path), tmp_path, observations=True)
    assert not verdict.stands
    assert "observation_checks" in verdict.routes[0].problems[0]


def test_a_table_that_does_not_match_is_refused(folder, tmp_path, capsys):
    copy = tmp_path / "run"
    shutil.copytree(folder, copy)
    table = json.loads((copy / "results.json").read_text())
    table["_checkpoint"]["records"][1]["scores"]["score_composed"] += 0.1
    (copy / "results.json").write_text(json.dumps(table))
    assert main(["verify", str(copy)]) == 1
    shown = capsys.readouterr().out
    assert "_checkpoint.records[1].scores.score_composed is " in shown
    assert "The claim does not stand" in shown


def test_an_altered_run_ends_with_1_and_names_the_route(run, tmp_path, capsys):
    record = run.routes[1]
    claim = replace(record, score=replace(record.score, infraction_score=1.0))
    write_run(tmp_path, replace(run, routes=(run.routes[0], claim)))
    assert main(["verify", str(tmp_path)]) == 1
    shown = capsys.readouterr().out
    assert f"route {ROUTE}, seed 1: score.infraction_score: claimed 1.0" in shown


@pytest.mark.parametrize(
    ("find", "put", "said"),
    [
        ('"driving_score":', '"driving_score":1', "is not the product of the others"),
        ('"run": "', '"run": "0', "belongs to another run"),
        ('"game_s": ', '"game_s": x', "is not whole JSON"),
    ],
)
def test_a_digit_altered_in_the_file_itself_is_refused(folder, tmp_path, find, put, said, capsys):
    copy = tmp_path / "run"
    shutil.copytree(folder, copy)
    path = copy / "routes" / "0001.json"
    text = path.read_text()
    assert find in text
    path.write_text(text.replace(find, put))
    assert main(["verify", str(copy)]) == 1
    shown = capsys.readouterr().out
    assert "The claim does not stand" in shown
    assert said in shown


def test_a_digit_too_small_to_change_a_bit_is_found_too(folder, tmp_path, capsys):
    copy = tmp_path / "run"
    shutil.copytree(folder, copy)
    path = copy / "routes" / "0001.json"
    text = path.read_text()
    # 17 digits are more than a number of 64 bits needs: another last one may be the same number
    written, other = next(
        (number, number[:-1] + digit)
        for number in re.findall(r"-?\d+\.\d{13,}", text)
        for digit in "0123456789"
        if digit != number[-1] and float(number[:-1] + digit) == float(number)
    )
    path.write_text(text.replace(written, other, 1))
    assert main(["verify", str(copy)]) == 1
    shown = capsys.readouterr().out.replace("\n", " ")
    assert f"0001.json has {other}, a number that is written {written}" in shown


def test_a_folder_without_a_run_is_a_wrong_request(tmp_path, capsys):
    assert main(["verify", str(tmp_path)]) == 2
    assert "evaluate --output" in capsys.readouterr().err


def test_a_route_in_the_place_of_another_is_refused(run, tmp_path):
    twice = replace(run.routes[0], index=1)
    write_run(tmp_path, replace(run, routes=(run.routes[0], twice)))
    verdict = verify_run(read_run(tmp_path), tmp_path)
    assert "planned there is" in verdict.problems[0]


def test_a_run_on_another_footing_says_so(run, folder):
    other = replace(run, versions={**run.versions, "numpy": "1.0"})
    verdict = verify_run(other, folder)
    assert any("not 1.0" in difference for difference in verdict.differences)


def test_an_unfinished_run_says_so(run, tmp_path, capsys):
    write_table(tmp_path, run)
    write_run(tmp_path, replace(run, routes=run.routes[:1]))
    assert main(["verify", str(tmp_path)]) == 0
    assert "Not complete: 1 of 2" in capsys.readouterr().out
