"""Writes the shipped trigger files: `python -m di_envs.town.building.scenarios`.

Places follow from the lanes and junctions alone, so the same map gives the same file. Every lane of
a street gets the trigger at the same distance from its end, so that lane changes miss none. How
many there are, and how far from junctions, is as in the files that the field uses for CARLA's
Town05: nearly every junction on a route has one, and a kilometre of street two or three.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from di_envs.town.building.ways import streets
from di_envs.town.lanes import LaneKind, Lanes, Turn
from di_envs.town.loading import load_town
from di_envs.town.queries import pose_at
from di_envs.town.routing.traces import successors_of
from di_envs.town.routing.trigger_files import PlacedScenario, write_triggers
from di_envs.town.town import Town

SCENARIOS = Path(__file__).parents[1] / "data" / "scenarios"

# Before the junction [m]: enough to react at 50 km/h, and apart by more than the 2 m within which
# two triggers count as one place
TURN_BEFORE_M = 23.0  # scenario 4
LIGHT_BEFORE_M = 27.0  # scenarios 7 to 9, which share a place: the highest that fits the turn wins
UNLIT_BEFORE_M = 29.0  # scenario 10

DEBRIS_REACH_M = 75.0  # ahead of scenario 1, over which …
STRAIGHT_RAD = np.deg2rad(20.0)  # … a street bends no more than this
STREET_BEFORE_M = 40.0  # scenarios 1 and 3, from a junction at least
STREET_BEGIN_M = 8.0  # from a lane's start, so that who turns into it is straight by then
STREET_SPACING_M = 200.0


def build_scenarios(town: Town) -> list[PlacedScenario]:
    """Triggers for all scenarios, by street."""
    lanes = town.lanes
    found: list[PlacedScenario] = []
    roads: dict[tuple[int, bool], list[int]] = {}
    for lane in streets(lanes):
        roads.setdefault((int(lanes.road[lane]), bool(lanes.lane_id[lane] > 0)), []).append(lane)
    for number, street in enumerate(roads.values()):
        walkable = _has_sidewalk(lanes, street[0])
        for lane in street:
            found += _at_junction(town, lane, varied=number % 3 > 0)
            if number % 3 == 0 and walkable:
                found += _crossings(lanes, lane)
            elif number % 3 == 1:
                found += _debris(lanes, lane)
    return found


def _at_junction(town: Town, lane: int, *, varied: bool) -> Iterator[PlacedScenario]:
    """What may happen at the junction that a lane leads into.

    Args:
        varied: Whether turns at lights are scenarios 8 and 9, or variants of scenario 7.
    """
    lanes = town.lanes
    ahead = [c for c in successors_of(lanes, lane) if lanes.junction[c] >= 0]
    if not ahead:
        return
    turns = {Turn(int(lanes.turn[connector])) for connector in ahead}
    junction = int(lanes.junction[ahead[0]])
    if turns & {Turn.LEFT, Turn.RIGHT}:
        yield from _placed(lanes, lane, 4, TURN_BEFORE_M)
    if not town.signals.groups[junction]:
        yield from _placed(lanes, lane, 10, UNLIT_BEFORE_M)
        return
    yield from _placed(lanes, lane, 7, LIGHT_BEFORE_M)
    if varied:
        if Turn.LEFT in turns:
            yield from _placed(lanes, lane, 8, LIGHT_BEFORE_M)
        if Turn.RIGHT in turns:
            yield from _placed(lanes, lane, 9, LIGHT_BEFORE_M)


def _crossings(lanes: Lanes, lane: int) -> Iterator[PlacedScenario]:
    """Scenario 3: somebody steps onto the street."""
    for before_m in _along(lanes, lane):
        yield from _placed(lanes, lane, 3, before_m)


def _debris(lanes: Lanes, lane: int) -> Iterator[PlacedScenario]:
    """Scenario 1, where the street goes straight on."""
    for before_m in _along(lanes, lane):
        if _is_straight(lanes, lane, before_m):
            yield from _placed(lanes, lane, 1, before_m)


def _along(lanes: Lanes, lane: int) -> Iterator[float]:
    """Metres before a lane's end: before its middle, and every so often on both sides of that."""
    length_m = float(lanes.length_m[lane])
    middle_m = max(0.5 * length_m, STREET_BEFORE_M)
    count = int(0.5 * length_m // STREET_SPACING_M)
    for step in range(count, -count - 1, -1):
        before_m = middle_m + step * STREET_SPACING_M
        if STREET_BEFORE_M <= before_m <= length_m - STREET_BEGIN_M:
            yield before_m


def _is_straight(lanes: Lanes, lane: int, before_end_m: float) -> bool:
    """Whether a lane goes straight on from a place, for as far as debris lies."""
    rows = (float(lanes.length_m[lane]) - before_end_m + np.array([0.0, DEBRIS_REACH_M])) / float(
        lanes.spacing_m[lane]
    )
    first, last = np.minimum(rows.astype(int), int(lanes.count[lane]) - 1) + int(lanes.first[lane])
    return bool(np.ptp(lanes.points[first : last + 1, 3]) < STRAIGHT_RAD)


def _has_sidewalk(lanes: Lanes, lane: int) -> bool:
    """Whether there is a sidewalk on the lane's side of its road."""
    beside = (lanes.road == lanes.road[lane]) & (lanes.kind == LaneKind.SIDEWALK)
    return bool(np.any(np.sign(lanes.lane_id[beside]) == np.sign(lanes.lane_id[lane])))


def _placed(lanes: Lanes, lane: int, number: int, before_end_m: float) -> Iterator[PlacedScenario]:
    """A trigger at a distance from the lane's end, where the lane is that long."""
    at_m = float(lanes.length_m[lane]) - before_end_m
    if at_m >= 0.0:
        yield PlacedScenario(number, *map(float, pose_at(lanes, lane, at_m)))


def main() -> None:
    """Writes the trigger files of the shipped towns."""
    SCENARIOS.mkdir(exist_ok=True)
    for name, town in (("town05", "Town05"), ("toy", "toy")):
        placed = build_scenarios(load_town(name))
        write_triggers(SCENARIOS / f"{name}.json", town, placed)
        print(f"wrote {len(placed)} triggers to {SCENARIOS / name}.json")


if __name__ == "__main__":
    main()
