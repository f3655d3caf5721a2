"""Writes the shipped Town05-style map from its table: `python -m di_envs.town.building.town05`.

The table (`data/town05_facts.json`) holds what a person would measure on CARLA's Town05 with a
ruler: ends and corners of 38 streets to 0.1 m, corner radii, lane counts, heights of the elevated
road, and who must stop where. Everything else is computed.
"""

from __future__ import annotations

from pathlib import Path

from di_envs.town.building.junction_layout import town_text
from di_envs.town.building.street_plan import read_plan

DATA = Path(__file__).parents[1] / "data"
FACTS = DATA / "town05_facts.json"
TOWN05 = DATA / "town05.xodr"


def build_town05() -> str:
    """The OpenDRIVE text of the Town05-style town."""
    return town_text(read_plan(FACTS))


if __name__ == "__main__":
    TOWN05.write_text(build_town05(), encoding="utf-8", newline="\n")
    print(f"wrote {TOWN05}")
