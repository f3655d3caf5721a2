"""Where Windows or macOS lack a module or a signal: import, environments and the command line."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[3]
# As Python's own start-up file: what Windows' Python has not is hidden from all that is ours, in
# child processes too; what others need of it is loaded before.
HIDING = """
import concurrent.futures.process, faulthandler, multiprocessing.spawn, os, random, signal, sys
import multiprocessing.popen_spawn_posix, multiprocessing.resource_tracker, subprocess, tempfile
import asyncio, gymnasium, numba, platformdirs, rich.progress, tyro

for name in ("fcntl", "resource", "termios", "pwd", "grp"):
    sys.modules[name] = None
for name in ("SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGHUP"):
    delattr(signal, name)
for name in ("getuid", "sched_getaffinity", "O_NOFOLLOW"):
    delattr(os, name)
del faulthandler.register, faulthandler.unregister
"""
COMMAND = """
import sys
from leaderboard.commands.cli import main

if __name__ == "__main__":
    sys.exit(main({}))
"""
DRIVES = """
import numpy, gymnasium, di_envs
env = gymnasium.make("DriveInsight-Toy-v1", observations=("prompt",), traffic=2, walkers=1)
env.reset(seed=1)
env.step(numpy.zeros(3, numpy.float32))
many = gymnasium.make_vec("DriveInsight-Toy-v1", num_envs=2, observations=("prompt",))
many.reset(seed=1)
many.step(numpy.zeros((2, 3), numpy.float32))
many.close()
"""


@pytest.fixture
def run_there(tmp_path):
    """Runs code in a Python without these modules."""
    (tmp_path / "sitecustomize.py").write_text(HIDING)

    def run(code: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{TOP}"},
            capture_output=True,
            text=True,
            check=False,
        )

    return run


def test_environments_are_made_and_stepped(run_there):
    done = run_there(DRIVES)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("command", [["agents"], ["suites"], ["evaluate", "--help"]])
def test_the_command_line_works(run_there, command):
    done = run_there(
        f"import sys\nfrom leaderboard.commands.cli import main\nsys.exit(main({command}))"
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_every_module_can_be_imported(run_there):
    modules = sorted(
        str(path.relative_to(TOP).with_suffix("")).replace(os.sep, ".")
        for package in ("di_envs", "agents", "wrappers", "leaderboard")
        for path in (TOP / package).rglob("*.py")
        if path.stem not in ("__init__", "__main__")
    )
    done = run_there(f"import importlib\nfor name in {modules}:\n    importlib.import_module(name)")
    assert (done.returncode, done.stderr) == (0, "")


def test_a_route_is_evaluated_with_a_warning_that_there_are_no_locks(run_there, tmp_path):
    arguments = ["evaluate", "--agent", "constant", "--suite", "toy", "--traffic", "0"]
    arguments += ["--walkers", "0", "--route-ids", "0", "--output", str(tmp_path / "run")]
    done = run_there(
        f"import sys\nfrom leaderboard.commands.cli import main\nsys.exit(main({arguments}))"
    )
    assert done.returncode == 0, done.stderr
    assert "there are no file locks where" in done.stderr
    assert "DS" in done.stdout
