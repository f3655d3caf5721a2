"""The package `driveinsight`: version, console script and doctor, wherever something is missing."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import driveinsight
import leaderboard
from driveinsight import doctor

TOP = Path(__file__).resolve().parent.parent


def driven(*arguments: str, first: str = "", code: str = "from driveinsight import main; main()"):
    """The console script as its own process, with a folder before ours on the path."""
    path = os.pathsep.join(filter(None, (first, str(TOP))))
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=TOP.anchor,  # Python looks where it is called first
        env={**os.environ, "PYTHONPATH": path},
        timeout=300,
    )


def carlas(folder: Path) -> str:
    """A folder as CARLA's Python API: packages of our names, and none of ours in them."""
    for name in ("agents", "leaderboard"):
        (folder / name).mkdir()
        (folder / name / "__init__.py").write_text("")
    return str(folder)


def test_the_package_offers_what_the_leaderboard_offers():
    assert driveinsight.__version__ == version("driveinsight")
    assert driveinsight.evaluate is leaderboard.evaluate
    assert {"evaluate", "__version__", "main"} <= set(dir(driveinsight))


def test_importing_it_loads_nothing_of_ours():
    code = "import sys, driveinsight; print(*sorted(sys.modules))"
    loaded = driven(code=code).stdout.split()
    assert not {"numpy", "gymnasium", "di_envs", "leaderboard", "agents"} & set(loaded)


def test_beside_carlas_packages_the_script_says_what_to_put_first(tmp_path):
    done = driven("evaluate", "--agent", "expert", "--suite", "toy", first=carlas(tmp_path))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("error: `agents` is DriveInsight's package at")
    assert f"PYTHONPATH={TOP}:$PYTHONPATH" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    said = driven("--version", first=str(tmp_path))
    assert (said.returncode, said.stdout) == (0, f"driveinsight {driveinsight.__version__}\n")


def test_a_missing_package_is_named_with_what_brings_it():
    code = (
        "import sys; sys.modules['tyro'] = None\nfrom driveinsight.command import run\n"
        "sys.exit(run(['suites']))"
    )
    done = driven(code=code)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert "tyro" in done.stderr
    assert "`driveinsight doctor` says what" in done.stderr


def test_the_doctor_finds_all_well_here_and_names_what_hides_ours(tmp_path, monkeypatch, capsys):
    quick = [check for check in doctor.CHECKS if check.__name__ != "_route"]
    monkeypatch.setattr(doctor, "CHECKS", tuple(quick))
    assert doctor.examine() == 0, capsys.readouterr().out
    shown = capsys.readouterr().out
    for name in ("python", "packages", "names", "processor", "caches", "display", "ffmpeg"):
        assert f" {name}" in shown
    done = driven("doctor", first=carlas(tmp_path))
    assert done.returncode == 1
    assert "WRONG  names" in done.stdout
    assert f"-> put {TOP} before {tmp_path}" in done.stdout


def test_the_doctor_falls_over_nothing(monkeypatch, capsys):
    def broken():
        raise RuntimeError("no such luck")
        yield

    monkeypatch.setattr(doctor, "CHECKS", (broken,))
    assert doctor.examine() == 1
    assert "WRONG  broken      RuntimeError: no such luck" in capsys.readouterr().out


def test_completion_is_written_for_the_shells():
    done = driven("--tyro-print-completion", "bash")
    assert done.returncode == 0, done.stderr
    assert "evaluate" in done.stdout
