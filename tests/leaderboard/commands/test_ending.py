"""How commands end where a shell, a pipe or an encoding is in the way."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from leaderboard.commands.cli import main
from leaderboard.commands.ending import EXIT_PIPE
from leaderboard.records.results import write_run
from tests.leaderboard.made_records import route, run_of

DRIVEINSIGHT = (sys.executable, "-m", "leaderboard")


@pytest.fixture
def run(tmp_path):
    """The folder of a run, with a space in its name."""
    folder = tmp_path / "my runs" / "first"
    write_run(folder, run_of(*(route(route_id=str(n), index=n) for n in range(40))))
    return folder


def started(*arguments, options=(), **variables):
    """A command of its own, with what it prints."""
    return subprocess.Popen(
        [sys.executable, *options, "-m", "leaderboard", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, **variables},
    )


@pytest.mark.parametrize("arguments", [["show"], ["--help"]], ids=["show", "help"])
def test_whoever_pipes_into_head_sees_no_traceback(run, arguments):
    process = started(*arguments, *([run] if arguments == ["show"] else []), PYTHONUNBUFFERED="1")
    process.stdout.close()  # as `head` does once it has its lines
    said = process.stderr.read()
    process.stderr.close()
    assert (process.wait(), said) == (EXIT_PIPE, b"")


@pytest.mark.parametrize(
    "variables",
    [{"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "POSIX"}, {"LC_ALL": "C", "PYTHONUTF8": "0"}],
    ids=str,
)
def test_a_table_is_printed_in_any_encoding(run, variables):
    said, complaint = started("show", run, **variables).communicate()
    assert complaint == b""
    assert b"driving score" in said.lower() or b"DS" in said


@pytest.mark.parametrize("option", ["-O", "-OO"])
def test_commands_work_without_asserts_and_docstrings(run, option):
    said, complaint = started("show", run, options=[option]).communicate()
    assert (complaint, b"Traceback" in said, len(said) > 500) == (b"", False, True)
    process = started("evaluate", "--help", options=[option])
    said, _ = process.communicate()
    assert (process.returncode, b"--agent" in said) == (0, True)


def test_commands_that_are_named_next_can_be_copied_with_their_spaces(run, capsys):
    assert main(["compare", str(run), str(run)]) == 0
    assert f"Next: driveinsight verify '{run}'" in capsys.readouterr().out


def test_a_path_of_three_hundred_characters_is_as_good_as_any(tmp_path, capsys):
    folder = Path(tmp_path, *("a" * 100,) * 3)
    write_run(folder, run_of(route()))
    assert main(["show", str(folder)]) == 0
    assert "Traceback" not in capsys.readouterr().err
