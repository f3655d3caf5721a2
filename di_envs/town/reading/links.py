"""Which lane leads to which: lane, road and junction links as successor sets of driving lanes."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Int32
from di_envs.town.lanes import LaneKind
from di_envs.town.reading.records import Connection, OpenDrive, RoadLink, RoadRecord
from di_envs.town.reading.stretches import Record, Stretch


class Joint(NamedTuple):
    """Two lanes that meet, and at which end of its road's stations each does."""

    a: Record
    a_at_start: bool
    b: Record
    b_at_start: bool


def find_successors(document: OpenDrive, stretches: list[Stretch]) -> list[set[int]]:
    """For each lane the driving lanes that go on from its end."""
    lane_of = {
        record: index
        for index, stretch in enumerate(stretches)
        if stretch.kind == LaneKind.DRIVING
        for record in stretch.records
    }
    successors: list[set[int]] = [set() for _ in stretches]
    for joint in _joints(document):
        a, b = lane_of.get(joint.a), lane_of.get(joint.b)
        if a is None or b is None or a == b:
            continue
        a_leaves = stretches[a].forward != joint.a_at_start
        b_leaves = stretches[b].forward != joint.b_at_start
        if a_leaves and not b_leaves:
            successors[a].add(b)
        elif b_leaves and not a_leaves:
            successors[b].add(a)
    return successors


def as_ranges(sets: list[set[int]]) -> tuple[Int32, Int32]:
    """Sets as (start, members): those of i are members[start[i]:start[i + 1]], ascending."""
    start = np.zeros(len(sets) + 1, dtype=np.int32)
    start[1:] = np.cumsum([len(members) for members in sets])
    members = [member for group in sets for member in sorted(group)]
    return start, np.array(members, dtype=np.int32)


def reversed_links(successors: list[set[int]]) -> list[set[int]]:
    """Predecessor sets from successor sets."""
    predecessors: list[set[int]] = [set() for _ in successors]
    for lane, targets in enumerate(successors):
        for target in targets:
            predecessors[target].add(lane)
    return predecessors


def _joints(document: OpenDrive) -> Iterator[Joint]:
    index_of = {road.road_id: index for index, road in enumerate(document.roads)}
    for index, road in enumerate(document.roads):
        yield from _joints_within(index, road)
        for link, at_start in ((road.predecessor, True), (road.successor, False)):
            if link is not None and not link.is_junction and link.element_id in index_of:
                other = index_of[link.element_id]
                yield from _joints_between(document, index, at_start, other, link)
    for connections in document.junctions.values():
        for connection in connections:
            yield from _joints_of_connection(document, index_of, connection)


def _joints_within(index: int, road: RoadRecord) -> Iterator[Joint]:
    for number, (section, following) in enumerate(pairwise(road.sections)):
        for lane in section.lanes.values():
            for target in lane.successors:
                yield Joint((index, number, lane.lane_id), False, (index, number + 1, target), True)
        for lane in following.lanes.values():
            for target in lane.predecessors:
                yield Joint((index, number, target), False, (index, number + 1, lane.lane_id), True)


def _joints_between(
    document: OpenDrive, index: int, at_start: bool, other: int, link: RoadLink
) -> Iterator[Joint]:
    road = document.roads[index]
    number = _end_section(road, at_start)
    other_number = _end_section(document.roads[other], link.at_start)
    for lane in road.sections[number].lanes.values() if road.sections else ():
        for target in lane.predecessors if at_start else lane.successors:
            yield Joint(
                (index, number, lane.lane_id),
                at_start,
                (other, other_number, target),
                link.at_start,
            )


def _joints_of_connection(
    document: OpenDrive, index_of: dict[str, int], connection: Connection
) -> Iterator[Joint]:
    incoming = index_of.get(connection.incoming_road)
    connecting = index_of.get(connection.connecting_road)
    if incoming is None or connecting is None:
        return
    at_start = _incoming_end(document.roads[incoming], document.roads[connecting], connection)
    a_section = _end_section(document.roads[incoming], at_start)
    b_section = _end_section(document.roads[connecting], connection.at_start)
    for origin, target in connection.lane_links:
        yield Joint(
            (incoming, a_section, origin),
            at_start,
            (connecting, b_section, target),
            connection.at_start,
        )


def _incoming_end(incoming: RoadRecord, connecting: RoadRecord, connection: Connection) -> bool:
    """Whether the incoming road meets the connecting one at its start.

    The connecting road's own link knows it; a road that begins and ends at the same junction has
    no other way to tell. At a direct junction there is no connecting road, only the next one.
    """
    if not connection.is_direct:
        link = connecting.predecessor if connection.at_start else connecting.successor
        if link is not None and not link.is_junction and link.element_id == incoming.road_id:
            return link.at_start
    before = incoming.predecessor
    return before is not None and before.is_junction and before.element_id == connection.junction


def _end_section(road: RoadRecord, at_start: bool) -> int:
    return 0 if at_start else len(road.sections) - 1
