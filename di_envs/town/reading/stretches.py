"""Joins the lanes of consecutive lane sections into stretches: the lanes of the network.

Editors cut a road into sections wherever a mark changes; Town05 has 1037 of them, 704 shorter than
1 m. A lane ahead of a driver should be a lane, not a millimetre of one, so sections of a road are
joined while its driving lanes go on one to one.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from di_envs.town.lanes import LaneKind
from di_envs.town.reading.records import OpenDrive, RoadRecord, SectionRecord

MINIMUM_LENGTH = 0.01  # m; shorter leftovers of lanes that are not driven on are dropped

Record = tuple[int, int, int]  # road index, section, lane id

_TRAVELLED = (LaneKind.DRIVING, LaneKind.PARKING, LaneKind.SHOULDER, LaneKind.BIKING)


@dataclass(frozen=True, kw_only=True, slots=True)
class Stretch:
    """A lane over one or more sections; `section` and `lane_id` are those of its first."""

    road: int
    group: int  # counts the road's groups of joined sections
    section: int
    lane_id: int
    kind: LaneKind
    lane_ids: tuple[int, ...]  # in sections `section`, `section` + 1, …
    begin: float  # station along the road
    end: float
    forward: bool  # travelled in the direction of growing stations

    @property
    def records(self) -> list[Record]:
        """The lanes of sections that it is made of."""
        return [(self.road, self.section + i, lane) for i, lane in enumerate(self.lane_ids)]


def find_stretches(document: OpenDrive) -> list[Stretch]:
    """All lanes of the network, by road, then group of sections, then lane id from the right."""
    stretches: list[Stretch] = []
    for index, road in enumerate(document.roads):
        for group, (first, last) in enumerate(_groups(road)):
            driving = _driving_stretches(road, index, group, first, last)
            others = _other_stretches(road, index, group, first, last)
            stretches += sorted(driving + others, key=lambda s: (s.lane_id, s.section))
    return stretches


def _groups(road: RoadRecord) -> list[tuple[int, int]]:
    """Ranges [first, last) of sections through which the driving lanes go on one to one."""
    cuts = [
        i + 1 for i, (a, b) in enumerate(pairwise(road.sections)) if _continuation(a, b) is None
    ]
    edges = [0, *cuts, len(road.sections)]
    return [(a, b) for a, b in pairwise(edges) if b > a]


def _continuation(a: SectionRecord, b: SectionRecord) -> dict[int, int] | None:
    """How the driving lanes of `a` go on in `b`, if one to one, in order and side by side."""
    ours, theirs = _driving_ids(a), _driving_ids(b)
    links = {lane: a.lanes[lane].successors for lane in ours}
    if any(len(targets) != 1 for targets in links.values()):
        return None
    ahead = {lane: targets[0] for lane, targets in links.items()}
    same_side = all(lane * target > 0 for lane, target in ahead.items())
    return ahead if same_side and [ahead[lane] for lane in ours] == theirs else None


def _driving_ids(section: SectionRecord) -> list[int]:
    return sorted(i for i, lane in section.lanes.items() if i and lane.kind == LaneKind.DRIVING)


def _driving_stretches(
    road: RoadRecord, index: int, group: int, first: int, last: int
) -> list[Stretch]:
    chains = [[lane] for lane in _driving_ids(road.sections[first])]
    for a, b in zip(road.sections[first : last - 1], road.sections[first + 1 : last], strict=True):
        ahead = _continuation(a, b) or {}
        for chain in chains:
            chain.append(ahead[chain[-1]])
    return [_stretch(road, index, group, first, chain, LaneKind.DRIVING) for chain in chains]


def _other_stretches(
    road: RoadRecord, index: int, group: int, first: int, last: int
) -> list[Stretch]:
    """The lanes that are not driven on, joined while one of the same id and kind goes on."""
    running: dict[int, tuple[int, list[int], LaneKind]] = {}
    done: list[tuple[int, list[int], LaneKind]] = []
    for number in range(first, last):
        lanes = road.sections[number].lanes
        for lane_id, (_, chain, kind) in list(running.items()):
            if lane_id in lanes and lanes[lane_id].kind == kind:
                chain.append(lane_id)
            else:
                done.append(running.pop(lane_id))
        for lane_id, lane in lanes.items():
            if lane_id and lane.kind != LaneKind.DRIVING and lane_id not in running:
                running[lane_id] = (number, [lane_id], lane.kind)
    found = [_stretch(road, index, group, *entry) for entry in [*done, *running.values()]]
    return [stretch for stretch in found if stretch.end - stretch.begin >= MINIMUM_LENGTH]


def _stretch(
    road: RoadRecord, index: int, group: int, section: int, chain: list[int], kind: LaneKind
) -> Stretch:
    against = kind in _TRAVELLED and (chain[0] < 0) != road.right_hand
    return Stretch(
        road=index,
        group=group,
        section=section,
        lane_id=chain[0],
        kind=kind,
        lane_ids=tuple(chain),
        begin=road.sections[section].begin,
        end=road.sections[section + len(chain) - 1].end,
        forward=not against,
    )
