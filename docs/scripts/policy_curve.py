"""Draws docs/images/policy-training.png: the waypoint loss over all stages of a policy's training.

python docs/scripts/policy_curve.py runs/driveinsight/paper-0 runs/driveinsight/paper-1 …
"""

from __future__ import annotations

import argparse
from pathlib import Path

from matplotlib.figure import Figure

from agents.training.config import HELD_OUT
from agents.training.log import read_rows
from agents.training.loop import LOG_FILE

OUT = Path(__file__).resolve().parents[1] / "images" / "policy-training.png"


def main() -> None:
    """Draws."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="+", type=Path, help="folders of trainings, first to last")
    runs = parser.parse_args().runs
    figure = Figure(figsize=(max(9.0, 1.2 * len(runs)), 3.4), layout="constrained")
    axes = figure.add_subplot()
    end, ticks = 0.0, []
    for run in runs:
        rows = read_rows(run / LOG_FILE)
        span = rows[-1]["step"]
        places = [end + row["step"] / span for row in rows]
        (line,) = axes.plot(places, [row["waypoints"] for row in rows], linewidth=1.0)
        kept_out = [row for row in rows if HELD_OUT in row]
        values = [row[HELD_OUT] for row in kept_out]
        at = [end + row["step"] / span for row in kept_out]
        axes.plot(at, values, "o--", markersize=3, linewidth=0.8, color=line.get_color(), alpha=0.6)
        ticks.append((end + 0.5, f"{run.name}\n{span:.0f} steps"))
        end += 1.0
        axes.axvline(end, color="#c8ccd0", linewidth=0.8)
    axes.set_xticks([place for place, _ in ticks], [name for _, name in ticks], fontsize=8)
    axes.tick_params(axis="x", length=0)
    axes.set(ylim=(0.0, 3.0), xlim=(0.0, end), ylabel="waypoint loss [m]")
    axes.text(0.01, 0.02, "dots: drives kept out", transform=axes.transAxes, fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(OUT, dpi=110)
    print(f"Written: {OUT}")


if __name__ == "__main__":
    main()
