"""Draws what a policy's eyes say beside what truly is there, at moments of drives.

python docs/scripts/perception_pictures.py POLICY DRIVES     writes docs/images/perception.png
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from agents.driveinsight.reading import read_seen
from agents.driveinsight.semantics import likeliest
from agents.driveinsight.weights import from_pretrained
from agents.networks.grid import GridConfig
from agents.training.frames import read_drive
from agents.training.loading import town_of
from agents.training.moments import load_moments
from agents.training.perceiving import look
from agents.training.perception_metrics import SCORE
from agents.training.sequences import SequenceRenderer
from agents.training.variation import Variation

PICTURE = Path(__file__).resolve().parents[1] / "images" / "perception.png"
# By `BevClass`, and last who is hidden
_COLOURS = ("#ffffff", "#d9d9d9", "#f2c14e", "#d62728", "#7fa8d1", "#2ca02c", "#e6ddf0")
_SHOWN = ("red", "gold", "limegreen", "firebrick")  # by a signal's state
_MOTION_S = 1.0  # for which an arrow goes on


def draw_rows(
    axes: Axes, objects: NDArray[np.float32], signals: NDArray[np.float32], score: float
) -> None:
    """Boxes with an arrow of a second's way, and the stop line that governs."""
    for x, y, yaw, length, width, vx, vy, _, sure in objects.tolist():
        if sure < score:
            continue
        cos, sin = np.cos(yaw), np.sin(yaw)
        half = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * (0.5 * length, 0.5 * width)
        corners = half @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
        axes.add_patch(Polygon(corners[:, ::-1], fill=False, edgecolor="black", linewidth=0.8))
        axes.plot([y, y + _MOTION_S * vy], [x, x + _MOTION_S * vx], color="black", linewidth=0.8)
    for x, y, yaw, *states, presence in signals.tolist():
        if presence >= 0.5:
            side = 2.0 * np.array([-np.sin(yaw), np.cos(yaw)])
            colour = _SHOWN[int(np.argmax(states))]
            axes.plot([y - side[1], y + side[1]], [x - side[0], x + side[0]], colour, linewidth=3.0)


def draw_map(axes: Axes, semantics: NDArray[np.int64], grid: GridConfig, title: str) -> None:
    """Classes of cells, ahead is up."""
    extent = (grid.y_min_m, grid.y_max_m, grid.x_min_m, grid.x_max_m)
    shades = ListedColormap(_COLOURS)
    axes.imshow(semantics, cmap=shades, vmin=0, vmax=6, origin="lower", extent=extent, alpha=0.8)
    axes.plot(0.0, 0.0, "k^", markersize=5)
    axes.set(xlim=extent[:2], ylim=extent[2:])
    axes.set_title(title, fontsize=7)
    axes.set_axis_off()


def draw(policy_folder: Path, drives: Path, rows: int) -> None:
    """One row a moment: the narrow camera, the truth, what is seen."""
    policy = from_pretrained(policy_folder)
    assert policy.perception is not None
    length, grid = policy.config.memory_frames + 1, policy.config.grid
    chosen = load_moments([drives], 0.2).some(rows)
    figure, places = plt.subplots(rows, 3, figsize=(9.0, 3.0 * rows), layout="constrained")
    for row, (number, last) in enumerate(zip(chosen.drive, chosen.moment, strict=True)):
        drive = read_drive(chosen.paths[number])
        renderer = SequenceRenderer(policy.config, *town_of(drive), depth=False)
        moments = renderer.sequence(drive, int(last), length, Variation(share=0.0), row)
        with torch.inference_mode():
            heads, _ = look(policy.perception, moments, length)
            seen = read_seen(heads, grid)
        axes: Sequence[Axes] = places[row]
        axes[0].imshow(moments.images[-1][-1, 0].permute(1, 2, 0).numpy())
        axes[0].set_title(str(drive.facts["town"]), fontsize=7)
        axes[0].set_axis_off()
        targets = moments.targets
        truth = np.minimum(targets.semantics[-1].numpy(), len(_COLOURS) - 1)
        draw_map(axes[1], truth, grid, "what is there (boxes: in sight; pale: hidden)")
        draw_rows(axes[1], targets.objects[-1].numpy(), targets.signal[-1:].numpy(), 1.0)
        draw_map(axes[2], likeliest(heads.semantics[-1:])[0].numpy(), grid, "what is seen")
        draw_rows(axes[2], seen.objects[-1].numpy(), seen.signals[-1].numpy(), SCORE)
    figure.savefig(PICTURE, dpi=110)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("policy", type=Path, help="folder of a policy with sensors")
    parser.add_argument("drives", type=Path, help="folder of drives it has not learnt from")
    parser.add_argument("--rows", type=int, default=6)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    draw(arguments.policy, arguments.drives, arguments.rows)
    print(f"Written: {PICTURE}")
