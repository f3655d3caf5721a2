"""Draws a route of two runs from above at the same moments, one run a row.

python -m docs.scripts.two_runs BEFORE AFTER --route 17 --at 20 22 22.6 26 --words before now
writes docs/images/late-changes.jpg
"""

from __future__ import annotations

import argparse
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from benchmarks.failures import GAP_PX, PANEL_PX, TITLE_PX, moments
from leaderboard.records.results import read_run

OUT = Path(__file__).resolve().parents[1] / "images" / "late-changes.jpg"


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
        run = read_run(folder)
        wanted = (asked.route, asked.seed)
        record = next((r for r in run.routes if (r.route_id, r.seed) == wanted), None)
        if record is None:
            parser.error(f"{folder} has no route {asked.route} with seed {asked.seed}")
        panels = moments(run, record, asked.at)
        for column, (at_s, panel) in enumerate(zip(asked.at, panels, strict=False)):
            left, top = column * (PANEL_PX + GAP_PX), row * height
            pen.text((left + 4, top + 4), f"{words}: {at_s:g} s", "#1d2126", font)
            picture.paste(panel, (left, top + TITLE_PX))
    picture.save(OUT, quality=85)
    print(f"Written: {OUT}")


if __name__ == "__main__":
    main()
