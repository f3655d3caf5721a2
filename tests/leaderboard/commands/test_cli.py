"""The command line, as a user meets it: what it teaches, what it refuses, what it leaves behind."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from di_envs.suites import load_suite, suite_names
from leaderboard.commands.cli import EXIT_INTERRUPTED, EXIT_USAGE, main
from leaderboard.records.results import read_run

MISBEHAVING = Path(__file__).parents[1] / "misbehaving.py"
ROUTE = load_suite("toy").specs()[0].route_id
QUIET = ["--suite", "toy", "--traffic", "0", "--walkers", "0", "--route-ids", ROUTE]


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line with which a request is refused."""
    assert main(arguments) == EXIT_USAGE
    captured = capsys.readouterr()
    lines = captured.err.strip().splitlines()
    assert len(lines) == 1, captured.err
    assert "Traceback" not in captured.err
    return lines[0]


@pytest.mark.parametrize("command", ["evaluate", "show", "verify", "score", "compare"])
def test_help_teaches_by_example(command, capsys):
    with pytest.raises(SystemExit) as stopped:
        main([command, "--help"])
    assert stopped.value.code == 0
    assert f"  driveinsight {command} " in capsys.readouterr().out


def test_the_list_of_commands_has_a_line_or_two_for_each(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    listed = capsys.readouterr().out.partition("subcommands")[2]
    assert "evaluate" in listed
    assert "Examples" not in listed


def test_an_option_that_is_given_twice_is_refused_since_one_would_be_lost(capsys):
    edits = ["--intervene", "drop:obstacles", "--intervene=drop:bev"]
    line = refused(["evaluate", "--agent", "constant", *QUIET, *edits], capsys)
    assert "--intervene is given 2 times" in line
    assert '"drop:obstacles; drop:bev"' in line
    line = refused(["evaluate", "--agent", "constant", *QUIET, "--route_ids", "1"], capsys)
    assert "--route-ids is given 2 times" in line


def test_the_list_of_suites_is_complete_and_says_what_is_next(capsys):
    assert main(["suites"]) == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in suite_names())
    assert "Next: driveinsight evaluate" in shown


def test_the_list_of_agents_has_their_tracks(capsys):
    assert main(["agents"]) == 0
    shown = capsys.readouterr().out
    assert any("expert " in line and "PRIVILEGED" in line for line in shown.splitlines())
    assert any("constant" in line and "PROMPT" in line for line in shown.splitlines())


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (["--agent", "constant", "--suite", "town05_lng"], "did you mean 'town05_long'?"),
        (["--agent", "exprt", *QUIET], "did you mean 'expert'?"),
        (["--agent", "constant", "--suite", "toy", "--route-ids", "nowhere"], "nowhere"),
        (["--agent", "constant", "--suite", "toy", "--rules", "carla-1.O"], "'carla-1.0'?"),
        (["--agent", "constant", "--suite", "toy", "--routes", "missing.xml"], "missing.xml"),
        (["--agent", "constant", "--suite", "toy", "--town", "missing.xodr"], "missing.xodr"),
        (["--agent", "constant"], "suite=NAME"),
        (["--agent", "constant", "--suite", "toy", "--traffic", "-1"], "traffic"),
        (["--agent", "constant", "--suite", "toy", "--seeds", "0"], "at least 1"),
        (["--agent", "missing.py:Mine", *QUIET], "there is no file"),
    ],
)
def test_a_wrong_request_is_one_line_with_a_hint(arguments, hint, capsys, tmp_path):
    assert hint in refused(["evaluate", *arguments, "--output", str(tmp_path / "out")], capsys)
    assert not (tmp_path / "out").exists()


def test_an_unknown_option_is_refused_with_a_suggestion(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["evaluate", "--agent", "constant", "--suit", "toy"])
    assert stopped.value.code == EXIT_USAGE
    shown = capsys.readouterr().err
    assert "--suit" in shown
    assert "--suite" in shown


def test_an_unwritable_output_folder_is_refused_before_driving(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    line = refused(
        ["evaluate", "--agent", "constant", *QUIET, "--output", str(tmp_path / "file" / "x")],
        capsys,
    )
    assert "choose another --output" in line


def test_showing_what_is_not_there_or_not_ours_is_refused(capsys, tmp_path):
    assert "evaluate --output" in refused(["show", str(tmp_path / "nothing")], capsys)
    (tmp_path / "driveinsight.json").write_text("{")
    assert "not whole JSON" in refused(["show", str(tmp_path)], capsys)


def test_evaluate_ends_in_a_table_and_names_the_next_step(capsys, tmp_path):
    folder = tmp_path / "run"
    arguments = ["evaluate", "--agent", "constant", *QUIET, "--seeds", "2"]
    assert main([*arguments, "--output", str(folder)]) == 0
    shown = capsys.readouterr().out
    assert "constant on toy · track PROMPT · rules carla-1.0" in shown
    for command in ("report", "explain", "verify", "compare", "show"):
        assert f"driveinsight {command} {folder}" in shown
    assert [record.seed for record in read_run(folder).routes] == [0, 1]

    assert main(["show", str(folder)]) == 0
    assert capsys.readouterr().out in shown
    assert "--overwrite" in refused([*arguments, "--output", str(folder)], capsys)


def test_without_an_output_folder_a_new_one_is_made_each_time(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = ["evaluate", "--agent", f"{MISBEHAVING}:Raises", *QUIET]
    assert main(arguments) == 0
    assert main(arguments) == 0
    assert sorted(path.name for path in (tmp_path / "results").iterdir()) == [
        "Raises-toy",
        "Raises-toy-2",
    ]


def test_ctrl_c_keeps_what_is_finished_and_shows_it(tmp_path):
    """In a process of its own, as only there a signal does what it does to a user."""
    command = [sys.executable, "-m", "leaderboard", "evaluate"]
    command += ["--agent", f"{MISBEHAVING}:InterruptsTheRun", *QUIET]
    command += ["--no-isolate", "--seeds", "4", "--output", str(tmp_path / "run")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == EXIT_INTERRUPTED, done.stderr
    assert "interrupted: 2 of 4 routes are kept" in done.stderr
    assert "Traceback" not in done.stderr
    assert "Not complete: 2 of 4" in done.stdout
    content = json.loads((tmp_path / "run" / "results.json").read_text())
    assert content["_checkpoint"]["progress"] == [2, 4]


def test_the_command_line_loads_nothing_slow_until_it_must():
    slow = "numba gymnasium torch highway_env numpy"
    code = (
        "import sys, leaderboard.commands.cli; "
        f"print([name for name in '{slow}'.split() if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.filterwarnings("always::UserWarning")
def test_a_warning_is_one_line_shown_once(capsys, tmp_path, shared):
    town = shared / "data" / "xodr" / "Town05.xodr"
    routes = shared / "data" / "routes" / "routes_town05_short.xml"
    arguments = f"evaluate --agent constant --town {town} --routes {routes} --route-ids 4"
    main([*arguments.split(), "--traffic", "0", "--output", str(tmp_path / "out")])
    told = " ".join(capsys.readouterr().err.split())
    assert told.count("warning: Town05.xodr carries no traffic signals") == 1
    assert "UserWarning" not in told
