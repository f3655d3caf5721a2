"""Two checkouts of this repository side by side: the same works in turn, by processor time.

A busy machine slows both down alike, so the ratio of a pair of rounds, one just after the other,
says more than two runs do. Only one of the two processes works at a time.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from step_works import GROWTH, LOOKS, STANDING
from typing_extensions import Self

WORKS = Path(__file__).with_name("step_works.py")
HERE = WORKS.resolve().parents[1]
TITLES = {
    "world": "world tick, along a drive",
    "env": "`env.step`, observations `prompt`",
    **{f"{v} | {w}": f"world tick, {v} vehicles, {w} walkers, no ego" for v, w in GROWTH},
    **{look: f"a look, cameras `{look.split()[0]}`, {look.split()[1]}" for look in LOOKS},
    **{str(n): f"a world's `step`, of {n} in a thread, standing" for n in STANDING},
}


class Checkout:
    """A process that does works with the code of one checkout."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._process = subprocess.Popen(
            [sys.executable, str(WORKS), str(folder)],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(folder)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate()  # no more works: it ends

    def cpu_s(self, work: str) -> float:
        """Processor time of one thing, in a round of a work."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{work}\n")
        self._process.stdin.flush()
        return float(self._line())

    def _line(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            sys.exit(f"the process with the code of {self._folder} failed: see above")
        return line.strip()


def compare(against: Path, rounds: int, works: Sequence[str]) -> None:
    """Prints what each work costs here and in another checkout.

    Args:
        against: The other checkout's folder.
        rounds: Pairs of rounds of each work; one before them is not counted.
        works: Keys of `TITLES`.
    """
    with ExitStack() as stack:
        ours, theirs = (stack.enter_context(Checkout(folder)) for folder in (HERE, against))
        pairs: dict[str, list[tuple[float, float]]] = {work: [] for work in works}
        for k in range(rounds + 1):
            for work, own in pairs.items():
                if k % 2:  # each is as often the first
                    pair = ours.cpu_s(work), theirs.cpu_s(work)
                else:
                    pair = (theirs.cpu_s(work), ours.cpu_s(work))[::-1]
                own += [pair] if k else []
    print(f"\n## Processor time here and in `{against.name}`, {rounds} rounds in turn\n")
    print("| what | there, median [µs] | here | rate here, of there | least there [µs] | here |")
    print("|---|---:|---:|---:|---:|---:|")
    for work, own in pairs.items():
        print(f"| {TITLES[work]} | {_cells(own)} |")
    print(_ratio(pairs, "0 | 120", "0 | 60"), _ratio(pairs, "16", "1"), _ratio(pairs, "64", "1"))


def _ratio(pairs: dict[str, list[tuple[float, float]]], work: str, other: str) -> str:
    """What a work takes of another one here, by the median of the rounds' ratios; if both ran."""
    if not {work, other} <= pairs.keys():
        return ""
    found = [a / b for (a, _), (b, _) in zip(pairs[work], pairs[other], strict=True)]
    return f"\nHere: {TITLES[work]}: {statistics.median(found):.2f} times {TITLES[other]}."


def _cells(pairs: list[tuple[float, float]]) -> str:
    """Medians, the median of the ratios, and the best rounds."""
    here, there = zip(*pairs, strict=True)
    ratio = statistics.median(b / a for a, b in pairs)
    return (
        f"{1e6 * statistics.median(there):.1f} | {1e6 * statistics.median(here):.1f} | {ratio:.3f}"
        f" | {1e6 * min(there):.1f} | {1e6 * min(here):.1f}"
    )
