"""Runs the examples of docs/learning.md and scores what they wrote: prints the page's table.

    python docs/scripts/learners.py --output learners                    all of them
    python docs/scripts/learners.py --output learners --only TorchRL     those with such titles

Each runs in a process of its own, so the time of a processor that it took is its own, too. An
example whose packages are not here is left out, aloud. Scores are of `town05_tiny`, seed 0, as
`driveinsight evaluate --agent AGENT --suite town05_tiny --trust --no-isolate` gives them. The same
command goes on where it was stopped; an example whose text has changed since begins anew. The table
lies in `table.md` of the folder, too: a row for each example that has one.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

import tyro

from di_envs.suites import load_suite
from leaderboard import evaluate

SUITE = "town05_tiny"
TOP = Path(__file__).resolve().parents[2]
EXAMPLE = re.compile(r"^## (.+)\n(?:(?!## ).*\n)*?```python\n((?:(?!```).*\n)*)", re.MULTILINE)
STEPS = re.compile(r"^(?:\w+, )*STEPS(?:, \w+)* = ([\d_]+)", re.MULTILINE)
HEAD = "| example | steps | seconds of a core | DS before | DS after |\n|---|---:|---:|---:|---:|\n"


@dataclass(frozen=True, kw_only=True)
class Learners:
    """Which examples, and where what they write goes."""

    output: Path = Path("learners")
    """Folder, one inside it for each example."""

    only: str = ""
    """Part of the titles of those to run; all when empty."""

    every: int = 1
    """Scores on every so many-th route: 4 means routes 0, 4, 8 and so on."""


def folder_of(title: str, output: Path) -> Path:
    """Where what an example writes goes."""
    return output / re.sub(r"\W+", "-", title).strip("-").lower()


def trained(code: str, folder: Path) -> float | None:
    """Runs an example in a folder of its own, unless it has run there to its end already.

    Returns:
        The processor's seconds that it took, None if it failed.
    """
    text, took = folder / "learner.py", folder / "took.json"
    if took.exists() and text.read_text(encoding="utf-8") == code:
        return float(json.loads(took.read_text(encoding="utf-8"))["core_s"])
    if text.exists():
        shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    text.write_text(code, encoding="utf-8")
    before = getrusage(RUSAGE_CHILDREN)
    paths = {"PYTHONPATH": str(TOP)}
    with (folder / "output.txt").open("w", encoding="utf-8") as output:
        done = subprocess.run(
            [sys.executable, "learner.py"],
            stdout=output,
            stderr=subprocess.STDOUT,
            cwd=folder,
            env={**os.environ, "OMP_NUM_THREADS": "1", **paths},
            check=False,
        )
    after = getrusage(RUSAGE_CHILDREN)
    if done.returncode != 0:
        return None
    core_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    took.write_text(json.dumps({"core_s": core_s}), encoding="utf-8")
    return core_s


def agents_of(folder: Path) -> Iterator[tuple[str, str, str]]:
    """What an example wrote: a name, the agent before and the agent after."""
    for before in sorted(folder.glob("*_untrained.zip")):
        name = before.name.removesuffix("_untrained.zip")
        yield name, f"sb3:{before}", f"sb3:{folder / name}.zip"
    said = (folder / "output.txt").read_text(encoding="utf-8")
    found = dict(re.findall(r"^(before|after): pickled:(\S+)", said, flags=re.MULTILINE))
    if found:
        yield "", *(f"pickled:{folder / found[when]}" for when in ("before", "after"))


def score(agent: str, output: Path, routes: list[str]) -> float:
    """The driving score of an agent; a run that was stopped is gone on with.

    Raises:
        KeyboardInterrupt: If it was stopped again.
    """
    run = evaluate(
        agent,
        SUITE,
        routes=routes,
        output=output,
        resume=True,
        trust=True,
        isolate=False,  # the agents are the page's
    )
    if not run.complete:
        raise KeyboardInterrupt
    return run.driving_score


def rows_of(title: str, code: str, folder: Path, routes: list[str]) -> Iterator[str]:
    """The table's rows of an example: one for each agent that it trained."""
    spent_s = trained(code, folder)
    if spent_s is None:
        last = (folder / "output.txt").read_text(encoding="utf-8").strip().splitlines()[-1]
        print(f"{title} did not run: {last}", file=sys.stderr)
        return
    (steps,) = STEPS.findall(code)
    for name, *agents in agents_of(folder):
        scores = [
            score(agent, folder / f"{name}{when}", routes)
            for agent, when in zip(agents, ("before", "after"), strict=True)
        ]
        called = f"{title} (`{name}`)" if name else title
        told = " | ".join(f"{value:.1f}" for value in scores)
        yield f"| {called} | {steps.replace('_', ',')} | {spent_s:.0f} | {told} |\n"


def main(chosen: Learners) -> None:
    """Runs and scores them, and prints a row each."""
    page = (TOP / "docs" / "learning.md").read_text(encoding="utf-8")
    routes = [spec.route_id for spec in load_suite(SUITE).specs()][:: chosen.every]
    examples = EXAMPLE.findall(page)
    titles = [title for title, _ in examples]
    if not any(chosen.only in title for title in titles):
        sys.exit(f"error: no example is called '{chosen.only}'; there are: {'; '.join(titles)}")
    print(HEAD, end="", flush=True)
    for title, code in examples:
        if chosen.only not in title:
            continue
        folder = folder_of(title, chosen.output)
        rows = ""
        for row in rows_of(title, code, folder, routes):
            print(row, end="", flush=True)
            rows += row
        if rows:
            (folder / "rows.md").write_text(rows, encoding="utf-8")
    written = [folder_of(title, chosen.output) / "rows.md" for title in titles]
    table = HEAD + "".join(path.read_text(encoding="utf-8") for path in written if path.exists())
    (chosen.output / "table.md").write_text(table, encoding="utf-8")


if __name__ == "__main__":
    main(tyro.cli(Learners, description=__doc__))
