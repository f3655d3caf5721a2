"""A run cut short at any moment goes on as if nothing had been, or says why it cannot."""

from __future__ import annotations

import dataclasses
import io
import json
import platform
import shutil
from pathlib import Path

import pytest
from rich.console import Console

from benchmarks.kill_and_resume import contents, finish, start_and_kill
from di_envs.suites import load_suite
from di_envs.world_version import WORLD_VERSION
from leaderboard.records.folder_lock import folder_lock
from leaderboard.records.own_files import prepare_folder
from leaderboard.records.record import WORKER_DIED, RunRecord
from leaderboard.records.results import ResultsError, read_run, start_run, write_run
from leaderboard.records.resuming import resumed as continued
from leaderboard.running.jobs import RunSpec
from leaderboard.running.runner import Existing, evaluate

TOY = load_suite("toy")
ROUTES = tuple(spec.route_id for spec in TOY.specs())[:2]
SPEC = RunSpec(
    agent="random", options={"suite": "toy", "traffic": 4, "walkers": 2, "route_ids": ROUTES}
)
AGENT = """
from agents.constant import ConstantAgent
class Mine(ConstantAgent):
    pass
"""


def resumed(folder: Path, spec: RunSpec = SPEC, seeds: tuple[int, ...] = (0, 1)) -> RunRecord:
    return evaluate(
        spec,
        seeds,
        suite=TOY,
        folder=folder,
        existing=Existing.RESUME,
        console=Console(file=io.StringIO()),
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that nothing disturbed."""
    folder = tmp_path_factory.mktemp("whole")
    resumed(folder)  # of nothing: starts
    return folder


@pytest.fixture
def copy(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "copy"))


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.6, pytest.param(0.9, marks=pytest.mark.full)])
def test_killed_with_all_its_workers_and_resumed_a_run_is_identical(share, whole, tmp_path):
    """`benchmarks/kill_and_resume.py` does this at as many random moments as one likes."""
    assert whole.is_dir()  # so all is compiled, and the next run is as long as any
    whole_s = finish(tmp_path / "whole")
    kept = start_and_kill(tmp_path / "killed", share * whole_s)
    finish(tmp_path / "killed", "--resume")
    assert contents(tmp_path / "killed") == contents(tmp_path / "whole")
    assert kept <= len(read_run(tmp_path / "killed").routes) == 2 * len(TOY.specs())


def test_what_is_there_is_kept_and_the_rest_is_driven(whole, copy):
    before = (copy / "routes" / "0002.json").stat().st_mtime_ns
    (copy / "routes" / "0001.json").unlink()
    (copy / "results.json").unlink()
    (copy / ".driveinsight.json.k3j_x1zz.unfinished").write_text(
        "what a killed process was writing"
    )
    resumed(copy)
    assert contents(copy) == contents(whole)
    assert (copy / "routes" / "0002.json").stat().st_mtime_ns == before


def test_a_finished_run_is_left_as_it_is(whole, copy):
    resumed(copy)
    assert contents(copy) == contents(whole)


def test_a_route_file_cut_in_half_is_named_and_driven_again(whole, copy):
    path = copy / "routes" / "0001.json"
    text = path.read_text()
    path.write_text(text[: len(text) // 2])
    with pytest.warns(UserWarning, match=r"0001\.json is damaged: that route is driven again"):
        resumed(copy)
    assert contents(copy) == contents(whole)


def test_a_lost_route_is_driven_after_all(whole, copy):
    run = read_run(copy)
    lost = dataclasses.replace(run.routes[3], status=WORKER_DIED, reason="killed")
    write_run(copy, dataclasses.replace(run, routes=(*run.routes[:3], lost)))
    assert len(resumed(copy).scored) == 4
    assert contents(copy) == contents(whole)


def test_a_run_file_cut_in_half_is_written_anew_and_no_route_is_lost(whole, copy):
    path, route = copy / "driveinsight.json", copy / "routes" / "0002.json"
    before = route.stat().st_mtime_ns
    path.write_text(path.read_text()[:100])
    with pytest.warns(UserWarning, match=r"driveinsight\.json is damaged: it is written anew"):
        resumed(copy)
    assert contents(copy) == contents(whole)
    assert route.stat().st_mtime_ns == before


def test_a_run_with_other_seeds_is_refused_and_left_alone(copy):
    before = contents(copy)
    with pytest.raises(ResultsError, match="seeds was 0, 1, is 0, 2"):
        resumed(copy, seeds=(0, 2))
    assert contents(copy) == before


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"seeds": (0,), "planned": 2}, "the number of routes x seeds was 4, is 2"),
        ({"agent": "constant"}, "agent was random, is constant"),
        ({"rules": "carla-2.0"}, r"rules was carla-1\.0, is carla-2\.0"),
        ({"options": {"suite": "toy", "traffic": 5}}, "options 'traffic' was 4, is 5"),
        ({"suite_version": 99}, "suite_version was "),
        ({"cpu": "z80-00000000"}, "the CPU's capability was .*, is z80-00000000"),
        ({"versions": {"numpy": "1.0"}}, r"versions 'numpy' was \d.*, is 1\.0"),
        ({"versions": {"world": "0"}}, f"versions 'world' was {WORLD_VERSION}, is 0"),
        ({"agent_version": "random 2"}, "the agent's version was random 1, is random 2"),
        ({"town_hash": "00"}, "the hash of the town's map was .*, is 00"),
        ({"routes_hash": "00"}, "the hash of the routes was .*, is 00"),
    ],
)
def test_another_run_is_refused_with_what_differs(fields, message, whole):
    now = dataclasses.replace(read_run(whole), routes=(), **fields)
    with pytest.raises(ResultsError, match=message):
        continued(whole, now)


def test_a_run_goes_on_under_another_python(whole, copy, monkeypatch):
    (copy / "routes" / "0001.json").unlink()
    monkeypatch.setattr(platform, "python_version", lambda: "2.7")
    before = (copy / "routes" / "0002.json").stat().st_mtime_ns
    assert len(resumed(copy).routes) == 4
    assert (copy / "routes" / "0002.json").stat().st_mtime_ns == before
    routes = {name: text for name, text in contents(copy).items() if "routes" in str(name)}
    assert routes == {n: text for n, text in contents(whole).items() if "routes" in str(n)} != {}


def test_a_run_of_another_format_version_is_refused(copy):
    path = copy / "driveinsight.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "format_version": 1}))
    with pytest.raises(ResultsError, match="has format version 1"):
        resumed(copy)


def test_an_agent_whose_code_was_changed_is_another(tmp_path):
    agent = tmp_path / "mine.py"
    spec = dataclasses.replace(SPEC, agent=f"{agent}:Mine")
    agent.write_text(AGENT)
    resumed(tmp_path / "run", spec)
    agent.write_text(AGENT + "\n# and now for something completely different\n")
    with pytest.raises(ResultsError, match="the agent's version was file "):
        resumed(tmp_path / "run", spec)


def test_a_route_of_another_run_is_refused(copy):
    run = read_run(copy)
    write_run(copy, dataclasses.replace(run, seeds=(5, 6)))  # its routes with that run's name
    start_run(copy, run)
    with pytest.raises(ResultsError, match="belongs to another run"):
        resumed(copy)


def test_two_processes_never_write_into_one_folder(tmp_path):
    with folder_lock(tmp_path / "run"):
        with pytest.raises(ResultsError, match="another process is writing"):
            resumed(tmp_path / "run")
        assert (tmp_path / "run").is_dir()
    with folder_lock(tmp_path / "run"):
        pass
    assert list((tmp_path / "run").iterdir()) == []


def test_results_are_neither_replaced_nor_continued_unless_asked(copy):
    with pytest.raises(ResultsError, match="--resume to continue"):
        prepare_folder(copy)
