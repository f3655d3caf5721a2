"""The prompt-editing experiments drawn, a figure each, from the numbers of the record."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from leaderboard.studies.approaches import GREEN_SHOWN, RED_SHOWN
from leaderboard.studies.experiments import EXPERIMENTS, Judgement

INK, FAINT, WARM, COOL = "#1d2126", "#8b949c", "#b3261e", "#2459a6"
COLOURS = ("#2459a6", "#b3261e", "#1b7f5c", "#8a5a00", "#5f6670")


def write_prompt_picture(path: Path, judgement: Judgement) -> bool:
    """Writes a PNG.

    Returns:
        False without Matplotlib.

    Raises:
        OSError: If it cannot be written.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return False
    figure = Figure(figsize=(7.6, 3.6), layout="constrained")
    axes = figure.add_subplot()
    title = EXPERIMENTS[judgement.experiment].title
    verdict = judgement.verdict.value
    axes.set_title(f"{title}\nthe paper's finding: {verdict}", loc="left", fontsize=10)
    axes.spines[["top", "right"]].set_visible(False)
    _DRAW[judgement.experiment](axes, judgement.numbers)
    figure.savefig(path, dpi=130)
    return True


def _draw_route(axes: Any, numbers: Mapping[str, Any]) -> None:
    """The share of the shift that the ego went along with, by what was moved."""
    axes.axvline(0.0, color=FAINT, linewidth=0.8)
    axes.axvline(100.0, color=FAINT, linewidth=0.8, linestyle="--")
    shares = numbers["shares"]
    for place, (what, share) in enumerate(shares.items()):
        _dot(axes, share, place, COOL, "both sides" if place == 0 else None)
        for asked, reached in numbers["sides"][what].items():
            if reached is not None:
                left = float(asked) < 0.0
                label = f"moved {'left' if left else 'right'}" if place == 0 else None
                axes.plot(
                    100 * reached, place, "<" if left else ">", color=INK, alpha=0.6, label=label
                )
    _names(axes, [what.replace("+", " and\n").replace("_", " ") for what in shares])
    axes.set_xlabel(f"how far the ego moved over, in percent of the {numbers['asked_m']:g} m asked")
    axes.legend(frameon=False, fontsize=8)


def _draw_speed(axes: Any, numbers: Mapping[str, Any]) -> None:
    """Length of the planned path over the speed that is given."""
    doses = numbers["doses_mps"]
    for (target, curve), colour in zip(numbers["curves"].items(), COLOURS, strict=False):
        name = target.replace("+", " and ").replace("_", " ")
        axes.plot(doses, curve["mean"], "o-", color=colour, label=f"{name} given", markersize=4)
        if None not in curve["low"]:
            axes.fill_between(doses, curve["low"], curve["high"], color=colour, alpha=0.15)
    axes.axhline(numbers["unedited_m"], color=FAINT, linestyle="--", label="unedited, mean")
    axes.set(xlabel="speed that the policy is given [m/s]", ylabel="length of its planned path [m]")
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, fontsize=8)


def _draw_lights(axes: Any, numbers: Mapping[str, Any]) -> None:
    """Shares of approaches, edited and not."""
    names = {
        RED_SHOWN: "green shown as red:\nthe ego stands",
        GREEN_SHOWN: "red or yellow shown as green:\nthe ego drives over",
    }
    for place, edit in enumerate(names):
        _dot(axes, numbers["shares"][edit], place, WARM, "edited" if place == 0 else None)
        plain = numbers["unedited"][edit]["mean"]
        if plain is not None:
            label = "unedited" if place == 0 else None
            axes.plot(100 * plain, place, "s", color=FAINT, label=label)
    _names(axes, [*names.values()])
    axes.set_xlim(-5.0, 105.0)
    axes.set_xlabel("percent of the lights met")
    _legend_beside(axes)


def _draw_failures(axes: Any, numbers: Mapping[str, Any]) -> None:
    """By failure, how many more drives have it under each edit."""
    effects = numbers["effects"]
    names = list(next(iter(effects.values())))
    axes.axvline(0.0, color=FAINT, linewidth=0.8)
    for number, (edit, row) in enumerate(effects.items()):
        aside = 0.15 * (number - 0.5 * (len(effects) - 1))
        for place, name in enumerate(names):
            colour = COLOURS[number % len(COLOURS)]
            _dot(axes, row[name], place + aside, colour, edit if place == 0 else None)
    before = numbers["unedited"]
    _names(axes, [f"{name}\n(unedited {100 * before[name]:.0f} %)" for name in names])
    low, high = axes.get_xlim()
    axes.set_xlim(min(low, -10.0), max(high, 10.0))
    axes.set_xlabel("how many more drives, in percent of all")
    _legend_beside(axes)


def _legend_beside(axes: Any) -> None:
    """Intervals may reach across all of the picture."""
    axes.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _dot(axes: Any, found: Mapping[str, Any], place: float, colour: str, label: str | None) -> None:
    """A mean with its interval, in percent."""
    low, high = found["interval"]
    if low is not None and high is not None:
        axes.plot([100 * low, 100 * high], [place, place], color=colour, linewidth=2.0)
    axes.plot(100 * found["mean"], place, "o", color=colour, label=label)


def _names(axes: Any, names: list[str]) -> None:
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x", alpha=0.3)


_DRAW: Mapping[str, Callable[[Any, Mapping[str, Any]], None]] = {
    "route": _draw_route,
    "speed": _draw_speed,
    "map": _draw_failures,
    "lights": _draw_lights,
    "bev": _draw_failures,
}
