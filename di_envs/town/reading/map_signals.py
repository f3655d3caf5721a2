"""The signals that an OpenDRIVE file carries, with the approach lanes that they rule.

CARLA's towns put a signal where its pole stands and refer to it from the roads inside the junction
(`signalReference`, with the lanes for which it is valid). Those lanes' predecessors end at the stop
line.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from di_envs.town.lanes import LaneKind, Lanes, SignalKind
from di_envs.town.reading.arms import approached_junction
from di_envs.town.reading.records import OpenDrive, RoadRecord, SignalRecord
from di_envs.town.reading.sampling import LaneGeometry
from di_envs.town.reading.signals import Head, ordered
from di_envs.town.reading.stretches import Stretch

_TYPES = {
    "1000001": SignalKind.LIGHT,
    "206": SignalKind.STOP,
    "205": SignalKind.YIELD,
}
_NAMES = {
    "signal_3light": SignalKind.LIGHT,
    "stopsign": SignalKind.STOP,
    "stencil_stop": SignalKind.STOP,
    "yieldsign": SignalKind.YIELD,
}
_LAST_TURN = 1_000_000
_NEAR_M = 30.0  # a sign that no reference places rules lanes that end this near


def heads_in_map(
    document: OpenDrive, lanes: Lanes, stretches: list[Stretch], geometry: LaneGeometry
) -> list[Head]:
    """A head for each signal of the file that rules lanes into a junction."""
    lane_of = {
        record: index for index, stretch in enumerate(stretches) for record in stretch.records
    }
    places: dict[str, list[tuple[int, SignalRecord]]] = {}
    for index, road in enumerate(document.roads):
        for signal in road.signals:
            places.setdefault(signal.signal_id, []).append((index, signal))
    heads = []
    for signal_id, rows in places.items():
        origin = next(((index, s) for index, s in rows if not s.is_reference), None)
        kind = signal_kind(origin[1]) if origin is not None else None
        if origin is None or kind is None:
            continue
        ruled = sorted(
            {
                lane
                for index, row in rows
                for lane in _ruled_lanes(document.roads[index], index, row, lanes, lane_of)
            }
        ) or _lanes_beside(document.roads[origin[0]], origin, lanes)
        if ruled:
            heads.append(_head(document, geometry, lanes, signal_id, origin, kind, ruled))
    return ordered(heads)


def signal_kind(signal: SignalRecord) -> SignalKind | None:
    """What a signal is, by CARLA's types and names; None for all others (speed limits, …)."""
    if signal.type in _TYPES:
        return _TYPES[signal.type]
    name = signal.name.lower()
    return next((kind for start, kind in _NAMES.items() if name.startswith(start)), None)


def _head(
    document: OpenDrive,
    geometry: LaneGeometry,
    lanes: Lanes,
    signal_id: str,
    origin: tuple[int, SignalRecord],
    kind: SignalKind,
    ruled: list[int],
) -> Head:
    index, signal = origin
    x, y, z, heading = (
        float(value[0]) for value in geometry.road_pose(np.array([index]), np.array([signal.s]))
    )
    foot = (x - np.sin(heading) * signal.t, -(y + np.cos(heading) * signal.t), z)
    junctions = [approached_junction(lanes, lane) for lane in ruled]
    junction = max(set(junctions), key=lambda j: (junctions.count(j), -j))
    members = tuple(lane for lane, j in zip(ruled, junctions, strict=True) if j == junction)
    # Lights that no controller names come after those that one does, each road by itself.
    turn = document.light_order.get(signal_id, (_LAST_TURN, int(lanes.road[members[0]])))
    return Head(kind=kind, junction=junction, lanes=members, turn=turn, foot=foot)


def _ruled_lanes(
    road: RoadRecord,
    index: int,
    row: SignalRecord,
    lanes: Lanes,
    lane_of: dict[tuple[int, int, int], int],
) -> Iterator[int]:
    """Approach lanes of the lanes for which a signal or a reference is valid."""
    number = sum(section.begin <= row.s for section in road.sections[1:])
    for low, high in row.validity:
        for lane_id in range(min(low, high), max(low, high) + 1):
            lane = lane_of.get((index, number, lane_id))
            if lane is None or lanes.kind[lane] != LaneKind.DRIVING:
                continue
            if approached_junction(lanes, lane) >= 0:
                yield lane
            elif lanes.junction[lane] >= 0:
                yield from _approaches(lanes, lane)


def _approaches(lanes: Lanes, lane: int) -> Iterator[int]:
    """The lanes outside the junction that lead to a lane inside it."""
    seen, front = {lane}, [lane]
    while front:
        at = front.pop()
        for before in lanes.predecessor[
            lanes.predecessor_start[at] : lanes.predecessor_start[at + 1]
        ]:
            if lanes.junction[before] != lanes.junction[lane]:
                yield int(before)
            elif int(before) not in seen:
                seen.add(int(before))
                front.append(int(before))


def _lanes_beside(road: RoadRecord, origin: tuple[int, SignalRecord], lanes: Lanes) -> list[int]:
    """Where nothing says for whom a signal is: lanes on its side of the road that end near it."""
    index, signal = origin
    left = signal.t > 0.0
    found = []
    for lane in np.flatnonzero((lanes.road == index) & (lanes.kind == LaneKind.DRIVING)):
        end = lanes.road_m[lanes.first[lane] + lanes.count[lane] - 1]
        same_side = bool(lanes.lane_id[lane] > 0) == left
        near = abs(end - signal.s) <= min(_NEAR_M, 0.5 * road.length)
        if same_side and near and approached_junction(lanes, int(lane)) >= 0:
            found.append(int(lane))
    return found
