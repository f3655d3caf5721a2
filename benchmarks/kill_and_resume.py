"""Kills an evaluation at random moments, resumes it, and compares with one that was left alone.

    python benchmarks/kill_and_resume.py --times 20

Each time the whole process group gets SIGKILL, as when a machine goes down; then the same command
with --resume runs to its end. All that the result files say must be the same, to the last bit, but
for the wall-clock times that they name. Exits with 1 if anything differs.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

TOP = Path(__file__).resolve().parents[1]
CLOCKS = ("wall_s", "duration_system")  # the only fields that may differ


def command(folder: Path, *more: str) -> list[str]:
    """The evaluation: two workers, seven short routes with two seeds."""
    run = "evaluate --agent random --suite toy --traffic 8 --walkers 4 --seeds 2 --workers 2"
    return [sys.executable, "-m", "leaderboard", *run.split(), "--output", str(folder), *more]


def finish(folder: Path, *more: str) -> float:
    """Runs the evaluation to its end; how many seconds that took."""
    started_s = time.monotonic()
    subprocess.run(command(folder, *more), check=True, capture_output=True, cwd=TOP)
    return time.monotonic() - started_s


def start_and_kill(folder: Path, after_s: float) -> int:
    """Kills the evaluation and all its workers after so long; how many routes were finished."""
    process = subprocess.Popen(
        command(folder, "--resume"),
        cwd=TOP,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        process.wait(timeout=after_s)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    return len(list(folder.glob("routes/[0-9]*.json")))


def contents(folder: Path) -> dict[str, Any]:
    """What every file of a run says, but for the clocks; names of what else lies about, too."""
    return {
        str(path.relative_to(folder)): _without_clocks(json.loads(path.read_text("utf-8")))
        if path.suffix == ".json"
        else None
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def _without_clocks(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_clocks(item) for key, item in value.items() if key not in CLOCKS}
    return [_without_clocks(item) for item in value] if isinstance(value, list) else value


def main() -> int:
    """Kills and resumes as often as asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0, help="of the moments")
    arguments = parser.parse_args()
    moments = random.Random(arguments.seed)
    bad = 0
    with tempfile.TemporaryDirectory() as place:
        finish(Path(place, "first"))  # compiles, if need be
        whole_s = finish(Path(place, "whole"))
        whole = contents(Path(place, "whole"))
        print(f"undisturbed: {whole_s:.1f} s, {len(whole) - 2} routes")
        for number in range(arguments.times):
            folder, after_s = Path(place, str(number)), moments.uniform(0.0, whole_s)
            kept = start_and_kill(folder, after_s)
            finish(folder, "--resume")
            same = contents(folder) == whole
            bad += not same
            verdict = "identical" if same else "DIFFERENT"
            print(f"{number + 1:3}: killed after {after_s:5.2f} s, {kept:2} kept: {verdict}")
    print(f"{arguments.times - bad} of {arguments.times} identical to the undisturbed run")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
