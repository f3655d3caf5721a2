"""Where containers leave little: no home, a cache that cannot be written, few files open."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from di_envs.numerics.kernels import kernel_cache

TOP = Path(__file__).resolve().parents[3]
RUN = ["evaluate", "--agent", "constant", "--suite", "toy", "--route-ids", "0", "--traffic", "0"]
RUN += ["--walkers", "0", "--output", "run"]


def as_nobody() -> list[str]:
    """How a command runs as a user that has nothing; as who we are where we are not root.

    It may read all, as the interpreter of a root may lie in root's home, and write nothing.
    """
    if os.getuid() != 0:
        return []
    program = shutil.which("setpriv")
    if program is None:
        pytest.skip("there is no setpriv to be somebody else with")
    reads = ["--inh-caps=-all,+dac_read_search", "--ambient-caps=-all,+dac_read_search"]
    return [program, "--reuid=4242", "--regid=4242", "--clear-groups", *reads]


def run_in(folder: Path, words: list[str], **variables: str) -> subprocess.CompletedProcess[str]:
    """Runs a command with an environment of these variables and nothing else."""
    folder.chmod(0o777)
    for parent in folder.parents[:3]:  # pytest keeps its folders to itself
        parent.chmod(parent.stat().st_mode | 0o055)
    return subprocess.run(
        words,
        cwd=folder,
        env={"PATH": os.environ["PATH"], "PYTHONPATH": str(TOP), **variables},
        capture_output=True,
        text=True,
        check=False,
    )


def test_without_a_home_and_with_a_warm_cache_that_cannot_be_written_a_run_ends_in_a_table(
    tmp_path,
):
    words = [*as_nobody(), sys.executable, "-m", "leaderboard", *RUN]
    warm = str(kernel_cache().parent)
    done = run_in(tmp_path, words, HOME="/nonexistent", DRIVEINSIGHT_CACHE=warm)
    assert done.returncode == 0, done.stderr
    assert "Compiling" not in done.stderr
    assert "warning" not in done.stderr
    assert "DS" in done.stdout


def test_without_a_home_suites_and_agents_are_listed(tmp_path):
    for command in ("suites", "agents"):
        words = [*as_nobody(), sys.executable, "-m", "leaderboard", command]
        warm = str(kernel_cache().parent)
        done = run_in(tmp_path, words, HOME="/nonexistent", DRIVEINSIGHT_CACHE=warm)
        assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr


def limited(files: int, *more: str) -> list[str]:
    """A run that may have so many files open."""
    words = f'ulimit -n {files}; exec "$0" -m leaderboard "$@"'
    return ["bash", "-c", words, sys.executable, *RUN, *more]


def test_sixty_four_open_files_are_enough(tmp_path):
    warm = str(kernel_cache().parent)
    done = run_in(tmp_path, limited(64, "--workers", "2"), DRIVEINSIGHT_CACHE=warm)
    assert done.returncode == 0, done.stderr
    assert "DS" in done.stdout


def test_where_no_more_processes_can_be_started_it_is_said_in_a_line(tmp_path):
    warm = str(kernel_cache().parent)
    done = run_in(tmp_path, limited(14), DRIVEINSIGHT_CACHE=warm)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "pass fewer --workers, or allow more open files" in done.stderr
