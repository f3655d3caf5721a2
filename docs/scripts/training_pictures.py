"""Draws the seven training towns, all at one scale, with their lights, stop signs and routes.

python docs/scripts/training_pictures.py            writes docs/images/training_towns.png
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from agents.training.town_styles import TRAINING_TOWNS
from agents.training.towns import training_plans, training_town
from di_envs.town.lanes import LaneKind, SignalKind

PICTURE = Path(__file__).resolve().parents[1] / "images" / "training_towns.png"
_KINDS = {
    SignalKind.LIGHT: ("#d62728", "stop line with lights"),
    SignalKind.STOP: ("#1f77b4", "with a stop sign"),
}


def draw_town(axes: Axes, name: str) -> None:
    """One town, north up."""
    town, plans = training_town(name), training_plans(name)
    lanes = town.lanes
    for lane in np.flatnonzero(lanes.kind == LaneKind.DRIVING):
        points = lanes.points[lanes.first[lane] : lanes.first[lane] + lanes.count[lane]]
        axes.plot(points[:, 0], -points[:, 1], color="#b0b0b0", linewidth=0.9, zorder=1)
    route = plans[0].points
    axes.plot(route[:, 0], -route[:, 1], color="#2ca02c", linewidth=1.6, zorder=2, label="a route")
    kinds = town.signals.kind[town.signals.stop_signal]
    for kind, (colour, label) in _KINDS.items():
        place = town.signals.stop_pose[kinds == kind]
        axes.scatter(place[:, 0], -place[:, 1], s=5.0, color=colour, zorder=3, label=label)
    style = TRAINING_TOWNS[name]
    axes.set_title(f"{name}: {style.vehicles} vehicles, {style.walkers} walkers", fontsize=8)
    axes.set_aspect("equal")
    axes.set_axis_off()


def main() -> None:
    """Draws all towns and a scale."""
    figure, grid = plt.subplots(2, 4, figsize=(11.0, 6.0), layout="constrained")
    places = list(grid.flat)
    for axes, name in zip(places[:-1], TRAINING_TOWNS, strict=True):
        draw_town(axes, name)
    reach = max(max(np.abs([*axes.get_xlim(), *axes.get_ylim()])) for axes in places[:-1])
    for axes in places:
        axes.set(xlim=(-reach, reach), ylim=(-0.85 * reach, 0.85 * reach))
    last = places[-1]
    last.set_axis_off()
    last.set_aspect("equal")
    last.plot([-100.0, 100.0], [-60.0, -60.0], color="black")
    last.text(0.0, -45.0, "200 m", ha="center")
    last.legend(*places[0].get_legend_handles_labels(), loc="upper center", frameon=False)
    PICTURE.parent.mkdir(exist_ok=True)
    figure.savefig(PICTURE, dpi=110)
    print(f"Written: {PICTURE}")


if __name__ == "__main__":
    main()
