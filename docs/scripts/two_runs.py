"""Draws a route of two runs from above at the same moments, one run a row.

python docs/scripts/two_runs.py BEFORE AFTER --route 17 --at 20 22 22.6 26 --words before now
writes docs/images/late-changes.jpg
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw, ImageFont

from di_envs.course import load_course
from di_envs.drawing.view import MAP_PX, Renderer
from leaderboard.records.results import read_run
from leaderboard.replaying.replay import replay, replay_env

OUT = Path(__file__).resolve().parents[1] / "images" / "late-changes.jpg"
PANEL_PX, TITLE_PX, GAP_PX = 260, 24, 6


def moments(folder: Path, route_id: str, seed: int, times_s: Sequence[float]) -> Iterator[Any]:
    """The streets around the ego at moments of a recorded route."""
    run = read_run(folder)
    record = next(r for r in run.routes if (r.route_id, r.seed) == (route_id, seed))
    env = replay_env(run)
    renderer, wanted = Renderer(load_course(env.config.changes())), list(times_s)
    edge = (MAP_PX - PANEL_PX) // 2
    for step in replay(run, record, env=env):
        if wanted and step.time_s >= wanted[0] - 1e-6:
            wanted.pop(0)
            yield renderer.map(step.view).crop((edge, edge, edge + PANEL_PX, edge + PANEL_PX))
        if not wanted:
            return


def main() -> None:
    """Draws."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", nargs=2, type=Path, help="folders of results")
    parser.add_argument("--route", required=True, help="its id")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--at", nargs="+", type=float, required=True, help="moments [s]")
    parser.add_argument("--words", nargs=2, required=True, help="what is said of each run")
    asked = parser.parse_args()
    height = PANEL_PX + TITLE_PX
    picture = Image.new("RGB", (len(asked.at) * (PANEL_PX + GAP_PX), 2 * height), "#ffffff")
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(14)
    for row, (folder, words) in enumerate(zip(asked.runs, asked.words, strict=True)):
        panels = moments(folder, asked.route, asked.seed, asked.at)
        for column, (at_s, panel) in enumerate(zip(asked.at, panels, strict=True)):
            left, top = column * (PANEL_PX + GAP_PX), row * height
            pen.text((left + 4, top + 4), f"{words}: {at_s:g} s", "#1d2126", font)
            picture.paste(panel, (left, top + TITLE_PX))
    picture.save(OUT, quality=85)
    print(f"Written: {OUT}")


if __name__ == "__main__":
    main()
