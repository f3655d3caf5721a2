"""Cuts driving lanes where OpenDRIVE's lane sections change: CARLA's planner has one edge a piece.

The lane network joins sections, as a driver sees one lane where an editor saw seven. CARLA does
not, and each cut moves its route points, so they are found again from the OpenDRIVE text.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import LaneKind, Lanes
from di_envs.town.routing.traces import road_span_m, rows_of
from di_envs.town.town import Town

# libstdc++'s sizes of a growing hash table
_TABLE_SIZES = (13, 29, 59, 127, 257, 541, 1109, 2357, 5087, 10273, 20753, 42043)
_SAME_M = 1e-5  # two stations no further apart are one


class Piece(NamedTuple):
    """A driving lane within one lane section."""

    lane: int  # index into Lanes
    section: int  # of its road, in the order of the file
    begin_m: float  # along the reference line from the lane's begin, in the direction of travel
    end_m: float


def cut_lanes(town: Town) -> list[Piece]:
    """All pieces of a town's driving lanes, in the order in which CARLA goes through them.

    That order settles ties between equally long ways.
    """
    lanes = town.lanes
    begins = _section_begins(town)
    rank = {road: i for i, road in enumerate(_carla_road_order(town.road_names))}
    pieces = [
        piece
        for lane in np.flatnonzero(lanes.kind == LaneKind.DRIVING)
        for piece in _pieces_of(lanes, int(lane), begins.get(town.road_names[lanes.road[lane]]))
    ]
    return sorted(
        pieces,
        key=lambda piece: (
            rank[int(lanes.road[piece.lane])],
            piece.section,
            int(lanes.lane_id[piece.lane]),
            piece.begin_m,
        ),
    )


def _section_begins(town: Town) -> dict[str, NDArray[np.float64]]:
    """Stations at which each road's lane sections begin, by road id."""
    root = ET.fromstring(town.opendrive) if town.opendrive else ET.Element("OpenDRIVE")
    return {
        road.get("id", ""): np.sort(
            [float(section.get("s", "0")) for section in road.iterfind("lanes/laneSection")]
        )
        for road in root.iterfind("road")
    }


def _pieces_of(lanes: Lanes, lane: int, begins: NDArray[np.float64] | None) -> list[Piece]:
    stations = lanes.road_m[rows_of(lanes, lane)]
    first, last = float(stations[0]), float(stations[-1])
    low, high = min(first, last), max(first, last)
    begins = np.zeros(1) if begins is None else begins
    inside = begins[(begins > low + _SAME_M) & (begins < high - _SAME_M)]
    inside = inside[np.diff(inside, prepend=low) > _SAME_M]
    cuts_m = np.sort(np.abs(np.concatenate([[low, high], inside]) - first))
    cuts_m[-1] = road_span_m(lanes, lane)
    sign = 1.0 if last >= first else -1.0
    pieces = []
    for begin_m, end_m in zip(cuts_m[:-1].tolist(), cuts_m[1:].tolist(), strict=True):
        middle = first + sign * 0.5 * (begin_m + end_m)
        section = int(np.searchsorted(begins, middle, side="right")) - 1
        pieces.append(Piece(lane, section, begin_m, end_m))
    return pieces


def _carla_road_order(names: tuple[str, ...]) -> list[int]:
    """Indices of roads in the order of CARLA's hash map of road ids.

    CARLA keeps roads in a `std::unordered_map` by id. In GNU's library a new bucket goes to the
    front of the list, as does a new id within its bucket, and all are laid anew when the table
    grows. Files whose ids are not whole numbers keep their own order.
    """
    if not all(name.isdecimal() for name in names):
        return list(range(len(names)))
    order: list[int] = []
    for size in _TABLE_SIZES:
        buckets: dict[int, list[int]] = {}
        for road in [*order, *range(len(order), min(size, len(names)))]:
            buckets.setdefault(int(names[road]) % size, []).append(road)
        order = [road for bucket in reversed(buckets.values()) for road in reversed(bucket)]
        if len(order) == len(names):
            break
    return order
