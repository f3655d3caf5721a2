"""Writes the toy town, small enough to follow on paper: `python -m di_envs.town.building.toy`.

A rectangle of 200 m x 100 m with 2+2 lanes and corners of 20 m radius, and a 1+1 street across its
middle. That makes two T-junctions: the northern one, at (0, -50), has lights; at the southern one,
at (0, 50), the middle street has a stop sign. World frame: x east, y south.

    11 ---- 1 ---- 12       1: lights, 2: stop sign for street 13
     |      |      |        streets 11 (west), 12 (east), 13 (middle), all from 1 to 2
     |      13     |
     |      |      |
    11 ---- 2 ---- 12
"""

from __future__ import annotations

from pathlib import Path

from di_envs.town.building.junction_layout import town_text
from di_envs.town.building.street_plan import read_plan

DATA = Path(__file__).parents[1] / "data"
FACTS = DATA / "toy_facts.json"
TOY = DATA / "toy.xodr"


def build_toy() -> str:
    """The OpenDRIVE text of the toy town."""
    return town_text(read_plan(FACTS))


if __name__ == "__main__":
    TOY.write_text(build_toy(), encoding="utf-8", newline="\n")
    print(f"wrote {TOY}")
