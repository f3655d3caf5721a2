"""An ablation drawn: a line for each row, its difference of DS and interval, the paper's beside."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from di_envs.files.shown_text import in_figure
from leaderboard.studies.ablation import Ablation, RowFinding
from leaderboard.studies.effects import EQUIVALENT, MARGIN_DS, MATTERS

COLOURS = {MATTERS: "#b3261e", EQUIVALENT: "#1b7f5c"}
GREY, BAND, PAPER = "#5f6670", "#e8ecef", "#2459a6"
_NAME = 60  # letters of an agent that fit
_ROW_IN, _HEAD_IN, _WIDTH_IN = 0.27, 1.4, 8.0  # inches


def write_ablation_picture(path: Path, ablation: Ablation) -> bool:
    """Writes a PNG.

    Returns:
        False without Matplotlib, or without a row to draw.

    Raises:
        OSError: If it cannot be written.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return False
    rows = list(ablation.rows)
    if not rows:
        return False
    height = _HEAD_IN + _ROW_IN * len(rows)
    figure = Figure(figsize=(_WIDTH_IN, height), layout="constrained")
    axes = figure.add_subplot()
    axes.axvspan(-MARGIN_DS, MARGIN_DS, color=BAND, zorder=0)
    axes.axvline(0.0, color=GREY, linewidth=0.8, zorder=1)
    for place, row in enumerate(rows):
        _draw_row(axes, place, row)
    _mark_groups(axes, rows)
    axes.set_yticks(range(len(rows)), [in_figure(row.driven.row.edit) for row in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlabel("difference of driving score to the baseline, in the same worlds")
    axes.grid(axis="x", alpha=0.3)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.set_title(in_figure(_title(ablation)), loc="left", fontsize=10)
    figure.legend(handles=_legend(ablation), loc="outside lower center", ncols=5, frameon=False,
                  fontsize=8)  # fmt: skip
    figure.savefig(path, dpi=130)
    return True


def _draw_row(axes: Any, place: int, row: RowFinding) -> None:
    found = row.difference
    colour = COLOURS.get(row.verdict, GREY)
    if found.low is not None and found.high is not None:
        axes.plot([found.low, found.high], [place, place], color=colour, linewidth=2.0, zorder=2)
    axes.plot(found.mean, place, "o", color=colour, markersize=5.5, zorder=3)
    if row.paper_difference is not None:
        axes.plot(row.paper_difference, place, "x", color=PAPER, markersize=6.0, zorder=4)


def _mark_groups(axes: Any, rows: Sequence[RowFinding]) -> None:
    """A thin line where one group ends and the next begins."""
    for place in range(1, len(rows)):
        if rows[place].driven.row.group != rows[place - 1].driven.row.group:
            axes.axhline(place - 0.5, color=GREY, linewidth=0.5, linestyle=":")


def _title(ablation: Ablation) -> str:
    study = ablation.study
    drives = study.baseline.drives
    mean = sum(drive.driving_score for drive in drives) / max(len(drives), 1)
    name = study.agent if len(study.agent) <= _NAME else f"…{study.agent[1 - _NAME :]}"
    seeds = f"{len(study.seeds)} seed{'s' if len(study.seeds) > 1 else ''}"
    return (
        f"{name} on {study.suite}\n"
        f"baseline DS {mean:.1f}, {ablation.routes} distinct routes, {seeds}"
    )


def _legend(ablation: Ablation) -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    styles = {"marker": "o", "linewidth": 2.0, "markersize": 5.5}
    handles: list[Any] = [
        Line2D([], [], color=COLOURS[MATTERS], label="matters", **styles),  # type: ignore[arg-type]
        Line2D([], [], color=COLOURS[EQUIVALENT], label="equivalent", **styles),  # type: ignore[arg-type]
        Line2D([], [], color=GREY, label="undecided", **styles),  # type: ignore[arg-type]
        Patch(color=BAND, label=f"±{MARGIN_DS:g} DS"),
    ]
    if any(row.paper_difference is not None for row in ablation.rows):
        handles.append(
            Line2D([], [], color=PAPER, marker="x", linestyle="", label="the paper's Table 2")
        )
    return handles
