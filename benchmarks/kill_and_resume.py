"""Kills a command at random moments, repeats it, and compares with one that was left alone.

    python benchmarks/kill_and_resume.py --times 20
    python benchmarks/kill_and_resume.py --command train --times 10

Each time the whole process group gets SIGKILL, as when a machine goes down; then the same command
runs to its end, an evaluation with --resume. All that the files say must be the same, to the last
bit, but for the wall-clock times that they name. Exits with 1 if anything differs.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TOP = Path(__file__).resolve().parents[1]
CLOCKS = ("wall_s", "duration_system")  # the only fields that may differ
COLUMNS, ROWS = "drive_columns", "drives"  # of a study: their names, and a row for each drive
TOLD_S = re.compile(r"\b[\d.]+ (s|min|h)\b")  # how long something took, in a page
EXACT = (".npz", ".safetensors", ".csv")  # files that are compared as they are
UNFINISHED = ".unfinished"  # what a name ends in that was being written


@dataclass(frozen=True, kw_only=True)
class Killed:
    """A command that is killed: what it needs beforehand, and how it is called."""

    words: str  # {folder} is where it writes, {given} where what was prepared lies
    again: str = ""  # added when it is repeated
    prepare: Callable[[Path], object] = lambda given: None


def command(folder: Path, *more: str) -> list[str]:
    """The evaluation: two workers, seven short routes with two seeds."""
    return spelled(COMMANDS["evaluate"], folder, folder, *more)


def spelled(killed: Killed, folder: Path, given: Path, *more: str) -> list[str]:
    """A command's words, as they are run."""
    words = killed.words.format(folder=folder, given=given).split()
    return [sys.executable, "-m", "leaderboard", *words, *more]


def run(words: list[str]) -> float:
    """Runs a command to its end; how many seconds that took."""
    started_s = time.monotonic()
    subprocess.run(words, check=True, capture_output=True, cwd=TOP)
    return time.monotonic() - started_s


def kill(words: list[str], after_s: float) -> None:
    """Kills a command and all its workers after so long."""
    process = subprocess.Popen(
        words,
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


def finish(folder: Path, *more: str) -> float:
    """Runs the evaluation to its end; how many seconds that took."""
    return run(command(folder, *more))


def start_and_kill(folder: Path, after_s: float) -> int:
    """Kills the evaluation and all its workers after so long; how many routes were finished."""
    kill(command(folder, "--resume"), after_s)
    return len(list(folder.glob("routes/[0-9]*.json")))


def an_untrained_policy(given: Path) -> None:
    """A policy that reads the prompt alone, in a folder."""
    import torch

    from agents.driveinsight.config import config_named
    from agents.driveinsight.model import Policy
    from agents.driveinsight.weights import save_pretrained

    torch.manual_seed(0)
    save_pretrained(Policy(config_named("driveinsight-told")), given / "policy", "")


def a_run_of_it(given: Path) -> None:
    """A run of such a policy, over a route."""
    an_untrained_policy(given)
    words = f"evaluate --agent driveinsight:{given}/policy --suite toy --route-ids 0 1 "
    words += f"--traffic 4 --walkers 2 --output {given}/run"
    run([sys.executable, "-m", "leaderboard", *words.split()])


def some_drives(given: Path) -> None:
    """Two drives of the expert, to train on."""
    words = f"collect --frames 150 --towns small_grid --output {given}/data"
    run([sys.executable, "-m", "leaderboard", *words.split()])


COMMANDS = {
    "evaluate": Killed(
        words="evaluate --agent random --suite toy --traffic 8 --walkers 4 --seeds 2 --workers 2 "
        "--output {folder}",
        again="--resume",
    ),
    "train": Killed(
        words="train --config driveinsight-told --steps 60 --batch 4 --workers 1 "
        "--data {given}/data --output {folder} --check-routes 0",
        prepare=some_drives,
    ),
    "edit": Killed(
        words="edit --agent driveinsight:{given}/policy --suite toy --route-ids 0 --traffic 4 "
        "--walkers 2 --experiments speed --output {folder}",
        prepare=an_untrained_policy,
    ),
    "respond": Killed(
        words="respond {given}/run --routes all --output {folder}", prepare=a_run_of_it
    ),
}


def contents(folder: Path) -> dict[str, Any]:
    """What every file says, but for the clocks; names of what else lies about, too."""
    return {
        str(path.relative_to(folder)): _said(path)
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def _said(path: Path) -> Any:
    if path.suffix == ".json":
        said = json.loads(path.read_text("utf-8"))
        columns = said.get(COLUMNS, []) if isinstance(said, dict) else []
        return _without_clocks(said, [n for n, name in enumerate(columns) if name in CLOCKS])
    if path.suffix == ".md":
        return TOLD_S.sub("", path.read_text("utf-8"))
    return path.read_bytes() if path.suffix in EXACT else None


def _without_clocks(value: Any, places: Sequence[int] = ()) -> Any:
    """A value without the clocks by name, and in the rows of drives those at these places."""
    if not isinstance(value, dict):
        return (
            [_without_clocks(item, places) for item in value] if isinstance(value, list) else value
        )
    kept = {key: _without_clocks(item, places) for key, item in value.items() if key not in CLOCKS}
    if places and ROWS in kept:
        kept[ROWS] = [[x for n, x in enumerate(row) if n not in places] for row in kept[ROWS]]
    return kept


def main() -> int:
    """Kills and repeats as often as asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--command", choices=COMMANDS, default="evaluate")
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0, help="of the moments")
    arguments = parser.parse_args()
    killed = COMMANDS[arguments.command]
    moments = random.Random(arguments.seed)
    bad = 0
    with tempfile.TemporaryDirectory() as place:
        given = Path(place, "given")
        given.mkdir()
        killed.prepare(given)
        run(spelled(killed, Path(place, "first"), given))  # compiles, if need be
        whole_s = run(spelled(killed, Path(place, "whole"), given))
        whole = contents(Path(place, "whole"))
        print(f"undisturbed: {whole_s:.1f} s, {len(whole)} files", flush=True)
        for number in range(arguments.times):
            folder, after_s = Path(place, str(number)), moments.uniform(0.0, whole_s)
            again = spelled(killed, folder, given, *killed.again.split())
            kill(again, after_s)
            kept = len(contents(folder)) if folder.is_dir() else 0
            run(again)
            differ = _different(contents(folder), whole)
            bad += bool(differ)
            verdict = f"DIFFERENT: {', '.join(differ)}" if differ else "identical"
            print(
                f"{number + 1:3}: killed after {after_s:5.2f} s, {kept:2} files kept: {verdict}",
                flush=True,
            )
    print(f"{arguments.times - bad} of {arguments.times} identical to the undisturbed run")
    return 1 if bad else 0


def _different(here: dict[str, Any], there: dict[str, Any]) -> list[str]:
    """Files that say something else, or that only one has; not what a kill left unfinished."""
    names = sorted(name for name in here.keys() | there.keys() if not name.endswith(UNFINISHED))
    return [name for name in names if here.get(name, "none") != there.get(name, "none")]


if __name__ == "__main__":
    sys.exit(main())
