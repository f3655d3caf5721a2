"""A claim names its world by what the files hold; `verify` looks there, from any folder."""

from __future__ import annotations

import shutil
from dataclasses import replace

import pytest

from di_envs.suites import DATA, load_suite
from di_envs.town import cache
from di_envs.town.loading import load_town
from leaderboard.commands.cli import main
from leaderboard.records.carla.results import carla_results
from leaderboard.records.claim_text import claim_lines
from leaderboard.records.results import read_run, write_run
from leaderboard.replaying.verify import verify_run
from leaderboard.replaying.world_problems import world_problems
from tests.leaderboard.short_drives import short_run

DECISIONS = 10
EVALUATE = ("evaluate", "--agent", "constant", "--traffic", "0", "--walkers", "0")


@pytest.fixture(scope="module")
def run():
    return short_run("constant", DECISIONS, traffic=0, walkers=0)


@pytest.fixture
def own_files(tmp_path, monkeypatch):
    """A run over files of the user's own, named by relative paths."""
    (tmp_path / "made" / "maps").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "made")
    shutil.copy(DATA / "toy.xodr", "maps/toy.xodr")
    shutil.copy(DATA / "routes" / "toy.xml", "toy.xml")
    files = ("--town", "maps/toy.xodr", "--routes", "toy.xml", "--scenarios", "none")
    assert main([*EVALUATE, *files, "--route-ids", "1", "--output", "run"]) == 0
    return tmp_path / "made"


def test_a_claim_over_own_files_verifies_from_any_folder(own_files, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["verify", "made/run"]) == 0
    assert "The claim stands" in capsys.readouterr().out
    # and where its files have gone with it
    shutil.copy(own_files / "maps" / "toy.xodr", own_files / "run")
    shutil.copy(own_files / "toy.xml", own_files / "run")
    shutil.move(own_files / "run", tmp_path / "sent")
    shutil.rmtree(own_files)
    assert main(["verify", "sent"]) == 0


@pytest.mark.parametrize("name", ["maps/toy.xodr", "toy.xml"])
def test_a_map_or_route_file_edited_since_is_named(own_files, name, capsys):
    path = own_files / name
    path.write_text(path.read_text() + "<!-- as good as the old one -->\n")
    assert main(["verify", "run"]) != 0
    said = capsys.readouterr()
    assert "here" in said.out + said.err


def test_a_world_is_named_by_each_thing_that_it_is_made_of(run):
    assert run.world.keys() == {"suite", "town", "signals", "routes", "scenarios"}
    assert list(world_problems(run)) == []
    for name in run.world:
        other = replace(run, world={**run.world, name: "0" * 32})
        (problem,) = world_problems(other)
        assert problem.startswith(f"its {name} is not the one here: it was driven with 000")
    (problem,) = world_problems(replace(run, world={}))
    assert "does not name its world" in problem


@pytest.mark.parametrize(
    "claim",
    [
        {"suite": "town05_long", "suite_version": load_suite("town05_long").version},
        {"suite_version": 99},
        {"suite_version": 0},
    ],
)
def test_a_shipped_suite_is_the_one_that_is_shipped(run, claim):
    (problem,) = world_problems(replace(run, **claim))
    assert "is claimed, its options choose 'toy' version" in problem


def test_a_benchmark_that_an_agent_chose_is_named(run, tmp_path):
    asked = {**run.requires, "options": {"routes": "easy.xml"}}
    chosen = replace(run, requires=asked)
    write_run(tmp_path, chosen)
    verdict = verify_run(read_run(tmp_path), tmp_path)
    assert not verdict.stands
    assert verdict.problems[0] == "its agent chose its own benchmark: it asked for routes"


def test_an_edited_cache_of_towns_is_found_out(tmp_path, monkeypatch):
    monkeypatch.setenv("DRIVEINSIGHT_CACHE", str(tmp_path / "cache"))
    town = load_town("toy")
    faster = town.lanes._replace(speed_limit_mps=town.lanes.speed_limit_mps * 2.0)
    cache.store(replace(town, lanes=faster))  # with the digest that goes with it
    run = short_run("constant", 1, traffic=0, walkers=0)
    write_run(tmp_path / "run", run)
    assert not any("town" in problem for problem in world_problems(run))  # its name is right
    assert not verify_run(read_run(tmp_path / "run"), tmp_path / "run").stands


def test_what_was_asked_for_stands_in_table_and_verdict(run, tmp_path, capsys):
    write_run(tmp_path, run)
    assert main(["show", str(tmp_path)]) == 0
    main(["verify", str(tmp_path)])
    shown = capsys.readouterr().out.replace("\n", " ")
    asked = "The agent asked for: prompt, a decision every 0.1 s."
    assert shown.count(asked) == 2
    assert shown.count("traffic=0") == 2


def test_a_drive_in_a_changed_world_says_so_and_is_not_eligible(run):
    (record,) = run.routes
    changed = replace(run, routes=(replace(record, interventions=("remove:actor=1@t=1",)),))
    (line,) = (line for line in claim_lines(changed) if "changed" in line)
    assert line.startswith("The world of 1 of 1 routes was changed: remove:actor=1@t=1.")
    for rules in ("carla-1.0", "carla-2.1"):
        there = [carla_results(replace(each, rules=rules))["eligible"] for each in (run, changed)]
        assert there == [True, False]


def test_a_run_that_was_not_isolated_says_so(run):
    own = replace(run, agent="mine.py:Mine")
    assert any("--no-isolate" in line for line in claim_lines(own))
    assert not any("--no-isolate" in line for line in claim_lines(replace(own, isolated=True)))
    assert not any("--no-isolate" in line for line in claim_lines(run))
