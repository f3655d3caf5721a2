"""How responses change with the situation, over several drives: one figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from di_envs.files.shown_text import in_figure
from leaderboard.pages.response_figures import DPI, SITUATION_COLOURS
from leaderboard.responding.by_situation import ratios_in
from leaderboard.responding.drive_responses import DriveResponses, plain_words


def situation_figure(drives: Sequence[DriveResponses]) -> Figure:
    """How each component's response changes with the situation: ratios with their intervals."""
    found = {name: ratios_in(drives, name) for name in drives[0].situations}
    shown = {name: ratios for name, ratios in found.items() if ratios}
    groups = drives[0].groups
    figure = Figure(figsize=(10.0, 1.8 + 0.52 * len(groups)), dpi=DPI, layout="constrained")
    axes: Any = figure.subplots()
    figure.suptitle(
        f"Responses in a situation, over those in all other moments\n{in_figure(drives[0].name)}, "
        f"{len(drives)} drives",
        fontsize=11,
    )
    step = 0.8 / max(len(shown), 1)
    for row, (name, ratios) in enumerate(shown.items()):
        for place, group in enumerate(groups):
            ratio = ratios[group]
            height = place - 0.4 + (row + 0.5) * step
            colour = SITUATION_COLOURS[name]
            if ratio.low is not None and ratio.high is not None:
                axes.plot([ratio.low, ratio.high], [height, height], color=colour, lw=2.4)
            label = in_figure(plain_words(name)) if place == 0 else None
            axes.plot(ratio.value, height, "o", ms=4.5, color=colour, label=label)
    axes.axvline(1.0, color="black", lw=1.0)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(labelsize=8)
    axes.set_yticks(
        range(len(groups)), [in_figure(plain_words(name)) for name in groups], fontsize=9
    )
    axes.invert_yaxis()
    axes.grid(axis="x", which="both", alpha=0.25)
    axes.set_xlabel("ratio of mean strengths, 95 % intervals over routes")
    if shown:
        axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure
