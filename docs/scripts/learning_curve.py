"""Draws how a policy learned, from the log that `examples/train_ppo.py` writes.

python docs/scripts/learning_curve.py ppo.monitor.csv docs/images/ppo.png --random 37 --constant 62
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import tyro

EPISODES = 300  # averaged over


@dataclass(frozen=True, kw_only=True)
class Curve:
    """What to draw, and where to."""

    log: Annotated[Path, tyro.conf.Positional]
    """The episodes, one a line: return, length, driving score, …"""

    picture: Annotated[Path, tyro.conf.Positional]
    """A PNG."""

    random: float
    """Driving score of the agent `random`, for comparison."""

    constant: float
    """Driving score of the agent `constant`."""


def read_episodes(log: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Decisions taken by the end of each episode, its driving score and route completion."""
    with log.open(encoding="utf-8") as file:
        next(file)  # a comment
        rows = list(csv.DictReader(file))
    length, score, done = (
        np.array([float(row[name]) for row in rows])
        for name in ("l", "driving_score", "route_completion")
    )
    return np.cumsum(length), score, done


def smoothed(values: np.ndarray) -> np.ndarray:
    """Means over windows of `EPISODES`."""
    return np.convolve(values, np.full(EPISODES, 1.0 / EPISODES), mode="valid")


def main(curve: Curve) -> None:
    """Draws and saves."""
    decisions, score, done = read_episodes(curve.log)
    figure, axes = plt.subplots(figsize=(7.2, 3.8), dpi=120, layout="constrained")
    x = decisions[EPISODES - 1 :] / 1000.0
    axes.plot(x, smoothed(done), color="0.6", lw=1.2, label="PPO in training, route completion")
    axes.plot(x, smoothed(score), color="tab:blue", lw=2.0, label="PPO in training, driving score")
    for name, value, style in (
        ("constant", curve.constant, "--"),
        ("random", curve.random, ":"),
    ):
        axes.axhline(value, color="tab:orange", ls=style, label=f"{name}, driving score")
    axes.set_xlabel("decisions of 0.2 s, thousands")
    axes.set_ylabel(f"mean of the last {EPISODES} episodes")
    axes.set_xlim(0.0, decisions[-1] / 1000.0)
    axes.set_ylim(0.0, 100.0)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right", fontsize=8)
    axes.set_title("PPO on the single crossings of town05_tiny, from the prompt", fontsize=10)
    figure.savefig(curve.picture)


if __name__ == "__main__":
    main(tyro.cli(Curve, description=__doc__))
