"""Draws the pictures of docs/explaining.md from a run: situations, three drives, heads.

python docs/scripts/response_pictures.py results/mine --routes 24 9 17

Drives are looked at every half second; what `driveinsight respond` has measured is read from the
run's folder, and responses.md there holds the tables of the page.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from matplotlib.figure import Figure
from PIL import Image

from leaderboard.pages.response_figures import (
    gradient_figure,
    head_figure,
)
from leaderboard.pages.situation_figure import situation_figure
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.records.results import read_run
from leaderboard.responding.drive_responses import DriveResponses
from leaderboard.responding.measuring import measured
from leaderboard.responding.moments import marked_moments
from leaderboard.running.displays.work_bar import work_bar

IMAGES = Path(__file__).resolve().parents[1] / "images"
COLOURS = 48  # a palette: a third of the size
EVERY_S = 0.5


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """What to draw."""

    run: Annotated[Path, tyro.conf.Positional]
    """The run's folder."""

    routes: tuple[str, str, str]
    """Three routes; the heads are of the first."""

    among: tuple[str, ...] = ()
    """Routes that the means are over; all of the run's if there are none."""


def save(figure: Figure, name: str) -> None:
    """Writes a small PNG."""
    path = IMAGES / f"responses-{name}.png"
    figure.savefig(path)
    with Image.open(path) as picture:
        small = picture.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    small.save(path, optimize=True)
    print(path)


def looked_at(run: RunRecord, records: list[RouteRecord], folder: Path) -> list[DriveResponses]:
    """Responses of these drives."""
    with work_bar("looking", "drives") as bar:
        task = bar.add_task("", total=len(records))
        found = []
        for drive in measured(run, records, folder, every_s=EVERY_S):
            found.append(drive)
            bar.advance(task)
    return found


def main(pictures: Pictures) -> None:
    """Measures what was not measured yet, and draws."""
    run = read_run(pictures.run)
    driven = [record for record in run.scored if record.steps]
    if pictures.among:
        driven = [record for record in driven if record.route_id in pictures.among]
    drives = looked_at(run, driven, pictures.run / "responses")
    save(situation_figure(drives), "situations")
    first = {drive.route_id: drive for drive in reversed(drives)}  # of its first seed
    chosen = [first[route] for route in pictures.routes]
    for drive in chosen:
        save(gradient_figure(drive, marked_moments(drive)), f"route-{drive.route_id}")
    save(head_figure(chosen[0], marked_moments(chosen[0])), "heads")


if __name__ == "__main__":
    main(tyro.cli(Pictures, description=__doc__))
