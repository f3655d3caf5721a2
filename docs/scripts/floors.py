"""Draws docs/images/floors.png, who may import whom, from the table that the tests enforce.

python docs/scripts/floors.py

A room is a folder, with what its docstring says first; it imports from its own floor and below.
"""

from __future__ import annotations

import ast
import runpy
import textwrap
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

TOP = Path(__file__).resolve().parents[2]
PICTURE = TOP / "docs" / "images" / "floors.png"
FLOORS: dict[str, tuple[set[str], ...]] = runpy.run_path(str(TOP / "tests" / "test_layout.py"))[
    "FLOORS"
]
WIDTH, GAP = 10.0, 0.08  # inches, as are all lengths here
HEAD, FLOOR = 0.34, 0.58
LETTERS_AN_INCH, LINES = 17.5, 2  # of the small print
# package: left and right side as shares of the width, on which package it stands, colour
HOUSES = {
    "di_envs": (0.0, 1.0, "", "#cfe3d4"),
    "agents": (0.0, 0.66, "di_envs", "#f3dfb8"),
    "wrappers": (0.66, 1.0, "di_envs", "#e6d2e6"),
    "leaderboard": (0.0, 1.0, "agents", "#cbdcf0"),
}


def said_of(package: str, room: str) -> str:
    """The first sentence of a folder's docstring, or what a package has right in it."""
    if not room:
        found = sorted(path.stem for path in (TOP / package).glob("[!_]*.py"))
        return ", ".join(found) if found else "the command line's entry"
    text = (TOP / package / room / "__init__.py").read_text(encoding="utf-8")
    first = (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]
    return first.rstrip(".").replace("`", "")


def draw_room(axes: Axes, package: str, room: str, x: float, y: float, width: float) -> None:
    """One folder at its place: its name, and what it is for."""
    colour = HOUSES[package][3]
    axes.add_patch(Rectangle((x, y), width, FLOOR - GAP, facecolor=colour, edgecolor="#555555"))
    name = f"{room}/" if room else f"{package}/*.py"
    axes.text(x + 0.07, y + FLOOR - GAP - 0.05, name, fontsize=8.5, weight="bold", va="top")
    told = textwrap.wrap(
        said_of(package, room),
        max(8, int(LETTERS_AN_INCH * (width - 0.14))),
        max_lines=LINES,
        placeholder=" …",
    )
    axes.text(x + 0.07, y + 0.04, "\n".join(told), fontsize=7, va="bottom", linespacing=1.05)


def draw_house(axes: Axes, package: str, ground: float) -> float:
    """A package, floor by floor.

    Returns:
        The height of its roof.
    """
    left, right, _, _ = HOUSES[package]
    x, width = WIDTH * left + GAP, WIDTH * (right - left) - 2 * GAP
    y = ground
    for rooms in FLOORS[package]:
        each = width / len(rooms)
        for number, room in enumerate(sorted(rooms)):
            draw_room(axes, package, room, x + number * each, y, each - GAP / 2)
        y += FLOOR
    axes.text(x, y + 0.03, package, fontsize=11, weight="bold", va="bottom")
    return y + HEAD


def main() -> None:
    """Draws all packages, each above those that it imports."""
    roofs = {"": 0.0}
    figure, axes = plt.subplots()
    for package, (_, _, below, _) in HOUSES.items():
        roofs[package] = draw_house(axes, package, roofs[below])
    height = max(roofs.values())
    axes.set(xlim=(0, WIDTH), ylim=(-GAP, height))
    axes.set_axis_off()
    figure.set_size_inches(WIDTH, height)
    figure.subplots_adjust(0, 0, 1, 1)
    figure.savefig(PICTURE, dpi=110)
    print(f"wrote {PICTURE}")


if __name__ == "__main__":
    main()
