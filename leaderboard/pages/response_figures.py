"""Responses of a drive, drawn as the paper draws them.

gradients   Gx and Gy of each component over the route, with marked moments
attention   shares of each head over the route
heads       shares of each head at the marked moments as bars, the drive's mean as a line
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from di_envs.files.shown_text import in_figure
from leaderboard.responding.drive_responses import DriveResponses, plain_words
from leaderboard.responding.moments import moment_name, stretches

MOMENT_COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:purple", "tab:brown", "tab:olive")
GROUP_COLOURS = (
    *("#4e79a7", "#a0cbe8", "#f28e2b", "#59a14f", "#b6992d"),
    *("#e15759", "#d37295", "#79706e", "#bab0ac", "#b07aa1"),
)
SITUATION_COLOURS = {
    "junction": "#8f8fd1",
    "turning": "#4bb3a5",
    "obstacle": "#d98d4f",
    "light": "#d96a6a",
    "stop_sign": "#b85fa8",
    "free": "#b9c48a",
}
DPI = 110


def write_figures(
    folder: Path, stem: str, drive: DriveResponses, marked: Sequence[int]
) -> tuple[Path, ...]:
    """Writes the figures of a drive as PNG.

    Args:
        folder: Where to; made if need be.
        stem: Begins the files' names.
        drive: What is drawn.
        marked: Indices of the moments to mark.

    Returns:
        The files.

    Raises:
        OSError: If they cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    figures = {"gradients": gradient_figure(drive, marked)}
    if drive.attention.size:
        figures["attention"] = attention_figure(drive, marked)
        figures["heads"] = head_figure(drive, marked)
    paths = []
    for name, figure in figures.items():
        path = folder / f"{stem}-{name}.png"
        figure.savefig(path)
        paths.append(path)
    return tuple(paths)


def gradient_figure(drive: DriveResponses, marked: Sequence[int]) -> Figure:
    """Gx and Gy of each component as curves, the situations below."""
    count = len(drive.groups)
    figure = Figure(figsize=(10.0, 1.6 + 0.85 * count), dpi=DPI, layout="constrained")
    rows: Any = figure.subplots(
        count + 1, 1, sharex=True, height_ratios=[1.0] * count + [1.6], squeeze=False
    )[:, 0]
    figure.suptitle(
        f"Gradients of the waypoints with respect to each component's tokens\n{_whose(drive)}",
        fontsize=11,
    )
    for place, (axes, name) in enumerate(zip(rows, drive.groups, strict=False)):
        axes.plot(drive.time_s, drive.gradient[:, place, 0], color="#1f4e79", lw=1.2, label="Gx")
        axes.plot(drive.time_s, drive.gradient[:, place, 1], color="#c8553d", lw=1.2, label="Gy")
        axes.set_ylabel(
            in_figure(plain_words(name)), rotation=0, ha="right", va="center", fontsize=9
        )
        axes.set_ylim(bottom=0.0)
        axes.yaxis.set_label_coords(-0.055, 0.5)
        _finish(axes, drive, marked)
    rows[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, fontsize=9, frameon=False)
    _situation_strips(rows[-1], drive)
    _finish(rows[-1], drive, marked, names=True)
    rows[-1].set_xlabel("game time [s]; G in metres of the mean waypoint per unit of token")
    return figure


def attention_figure(drive: DriveResponses, marked: Sequence[int]) -> Figure:
    """What each head attends to, as shares over the route."""
    _, layers, heads, _ = drive.attention.shape
    figure, panels = _panels(layers, heads, width=2.6, height=1.7, top=1.3)
    figure.suptitle(f"Attention of each head over the route\n{_whose(drive)}")
    for layer in range(layers):
        for head in range(heads):
            axes = panels[layer][head]
            shares = drive.attention[:, layer, head].T
            axes.stackplot(drive.time_s, shares, colors=_colours(drive), lw=0)
            axes.set_ylim(0.0, 1.0)
            axes.set_xlim(drive.time_s[0], drive.time_s[-1])
            for place, index in enumerate(marked):
                axes.axvline(drive.time_s[index], color=_colour(place), lw=1.3)
            _head_title(axes, layer, head)
            axes.tick_params(labelsize=7)
    for axes in panels[-1]:
        axes.set_xlabel("game time [s]", fontsize=8)
    patches = [_patch(colour) for colour in _colours(drive)]
    figure.legend(
        patches,
        [in_figure(plain_words(name)) for name in drive.groups],
        loc="outside lower center",
        ncols=5,
    )
    return figure


def head_figure(drive: DriveResponses, marked: Sequence[int]) -> Figure:
    """Bars for each head at the marked moments; the line is the mean over the drive."""
    _, layers, heads, count = drive.attention.shape
    figure, panels = _panels(layers, heads, width=2.7, height=1.9, top=1.9)
    figure.suptitle(f"Attention of each head at marked moments\n{_whose(drive)}")
    mean = drive.attention.mean(axis=0)
    step = 0.8 / max(len(marked), 1)
    for layer in range(layers):
        for head in range(heads):
            axes = panels[layer][head]
            for place, index in enumerate(marked):
                at = np.arange(count) - 0.4 + (place + 0.5) * step
                shares = drive.attention[index, layer, head]
                axes.bar(at, shares, step, color=_colour(place))
            axes.plot(mean[layer, head], color="crimson", lw=1.4, marker=".", ms=4)
            axes.set_xticks(np.arange(count), [""] * count)
            _head_title(axes, layer, head)
            axes.tick_params(labelsize=7)
    for axes in panels[-1]:
        labels = [in_figure(plain_words(name)) for name in drive.groups]
        axes.set_xticks(np.arange(count), labels, rotation=90, fontsize=7)
    names = [moment_name(drive, index) for index in marked]
    patches = [_patch(_colour(place)) for place in range(len(marked))]
    figure.legend(
        [*patches, _patch("crimson")], [*names, "mean of the drive"], loc="outside lower center"
    )
    return figure


def _panels(layers: int, heads: int, *, width: float, height: float, top: float) -> Any:
    size = (max(width * heads, 6.0), height * layers + top)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    return figure, figure.subplots(layers, heads, sharex=True, sharey="row", squeeze=False)


def _situation_strips(axes: Any, drive: DriveResponses) -> None:
    half = drive.every_s / 2.0
    for row, name in enumerate(drive.situations):
        for first, last in stretches(drive.holding(name)):
            start, end = drive.time_s[first] - half, drive.time_s[last - 1] + half
            axes.barh(row, end - start, left=start, height=0.8, color=SITUATION_COLOURS[name])
    names = [in_figure(plain_words(name)) for name in drive.situations]
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.invert_yaxis()


def _finish(axes: Any, drive: DriveResponses, marked: Sequence[int], names: bool = False) -> None:
    """Marks: moments as coloured lines, events as dotted ones."""
    for place, index in enumerate(marked):
        axes.axvline(drive.time_s[index], color=_colour(place), lw=1.6, alpha=0.9)
    for time_s, name in drive.events:
        axes.axvline(time_s, color="black", lw=1.0, ls=":")
        if names:
            where = axes.get_xaxis_transform()
            axes.text(time_s, 1.0, f"{name} ", fontsize=7, ha="right", transform=where)
    last_s = max([drive.time_s[-1], *(time_s for time_s, _ in drive.events)])
    axes.set_xlim(drive.time_s[0], last_s)
    axes.tick_params(labelsize=7)
    axes.spines[["top", "right"]].set_visible(False)


def _whose(drive: DriveResponses) -> str:
    return in_figure(f"{drive.name}, {drive.title}")


def _head_title(axes: Any, layer: int, head: int) -> None:
    axes.set_title(f"layer {layer}, head {head}", fontsize=8)


def _patch(colour: str) -> Any:
    return Patch(color=colour)


def _colour(place: int) -> str:
    return MOMENT_COLOURS[place % len(MOMENT_COLOURS)]


def _colours(drive: DriveResponses) -> list[str]:
    return [GROUP_COLOURS[place % len(GROUP_COLOURS)] for place in range(len(drive.groups))]
