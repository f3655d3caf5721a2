"""The wheel as people get it: in each Python claimed, from an empty folder, the same bits."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from leaderboard.records.results import read_run

TOP = Path(__file__).resolve().parent.parent
CLAIMED = ("3.10", "3.11", "3.12", "3.13")
DRIVE = ("evaluate", "--agent", "expert", "--suite", "toy", "--output", "run")
LONG_S = 1800  # to install, to compile and to drive, on a busy machine


def interpreter(claimed: str) -> str | None:
    """A Python of that version, if there is one: on the path, or pyenv's."""
    named = (shutil.which(f"python{claimed}"), sys.executable)
    pyenv = sorted(Path.home().glob(f".pyenv/versions/{claimed}.*/bin/python"))
    asked = "import sys; print(*sys.version_info[:2], sep='.')"
    for program in (*map(str, pyenv), *filter(None, named)):
        done = subprocess.run([program, "-c", asked], capture_output=True, text=True, check=False)
        if done.stdout.strip() == claimed:
            return program
    return None


def done(*command: str, folder: Path) -> None:
    """Runs a command where nothing of ours is to be found but what is installed."""
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    ended = subprocess.run(
        command, cwd=folder, env=env, capture_output=True, text=True, check=False, timeout=LONG_S
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr


def hashes(run: Path) -> list[tuple[str, ...]]:
    """What every route's bits are told by."""
    return [
        (r.route_id, r.route_hash, r.observation_hash, r.reward_hash, r.event_hash, r.state_hash)
        for r in read_run(run).routes
    ]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    done(sys.executable, "-m", "pip", "wheel", "--no-deps", "-w", ".", str(TOP), folder=folder)
    (found,) = folder.glob("*.whl")
    return found


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    folder = tmp_path_factory.mktemp("here")
    code = f"import sys; sys.path.insert(0, {str(TOP)!r}); from driveinsight import main; main()"
    done(sys.executable, "-c", code, *DRIVE, folder=folder)
    return hashes(folder / "run")


@pytest.mark.parametrize("claimed", CLAIMED)
def test_the_wheel_drives_the_toy_suite_with_the_bits_of_the_sources(
    claimed, wheel, here, tmp_path
):
    python = interpreter(claimed)
    if python is None:
        pytest.skip(f"there is no Python {claimed}")
    done(python, "-m", "venv", "venv", folder=tmp_path)
    programs = tmp_path / "venv" / "bin"
    done(str(programs / "python"), "-m", "pip", "install", str(wheel), folder=tmp_path)
    empty = tmp_path / "empty"
    empty.mkdir()
    done(str(programs / "driveinsight"), *DRIVE, folder=empty)
    assert hashes(empty / "run") == here
