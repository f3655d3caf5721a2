"""Turns a street plan into road records: arms, turns, corners, crosswalks and signals.

Each way across a junction is a road of its own with its lanes on the right, driven from start to
end. Frame: OpenDRIVE's, x east, y north, angles counter-clockwise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count, pairwise

from di_envs.town.alignment import Curve, Pose, curve_between, length_of, pose_at, wrapped
from di_envs.town.lanes import Turn
from di_envs.town.opendrive_writer import (
    CrosswalkRecord,
    JunctionRecord,
    ReferenceRecord,
    RoadEnd,
    RoadRecord,
    SignalRecord,
    opendrive_text,
)
from di_envs.town.street_plan import LANE_WIDTH_M, Control, Junction, Street, StreetPlan, Strip

_STRAIGHT_RAD = math.radians(45.0)
_FIRST_CONNECTOR = 2000  # ids of roads inside junctions start here,
_FIRST_CROSSWALK = 5000  # those of crosswalks here,
_FIRST_SIGNAL = 6000  # those of signals here,
_FIRST_CONTROLLER = 7000  # and those of controllers here
_CROSSWALK_AHEAD_M = 2.0  # its middle beyond the mouth, which is the stop line
_CROSSWALK_WIDTH_M = 3.0
_SIGNAL_BEFORE_MOUTH_M = 0.1
LIGHT, STOP = "1000001", "206"


@dataclass(frozen=True)
class Arm:
    """One end of a street, at a junction."""

    street: Street
    contact: str  # which end of the street: "start" or "end"
    mouth: Pose  # the street's middle there, heading into the junction

    @property
    def inbound_sign(self) -> int:
        """Sign of the ids of the lanes that lead into the junction."""
        return -1 if self.contact == "end" else 1

    def lane_id(self, lane: int, *, inbound: bool) -> int:
        """Lane id of driving lane 1, 2, … counted from the middle."""
        number = self.street.section.first_lane + lane - 1
        return number * (self.inbound_sign if inbound else -self.inbound_sign)

    def inbound_edge(self, right_m: float) -> Pose:
        """The mouth's pose `right_m` beside the middle, for those who enter."""
        return self.mouth.shifted(0.0, -right_m)

    def outbound_edge(self, right_m: float) -> Pose:
        """The mouth's pose `right_m` beside the middle, for those who leave."""
        return self.mouth.reversed().shifted(0.0, -right_m)

    def turn_to(self, other: Arm) -> float:
        """Change of heading from this arm into the other one [rad], left positive."""
        return wrapped(other.mouth.heading + math.pi - self.mouth.heading)


@dataclass(frozen=True)
class Movement:
    """Lanes that lead from one arm into another: `lanes` of them beside each other."""

    source: Arm
    target: Arm
    turn: Turn
    source_lane: int  # the innermost of them
    target_lane: int
    lanes: int


def town_text(plan: StreetPlan) -> str:
    """The OpenDRIVE text of a street plan."""
    heights = {street.id: _elevation(street) for street in plan.streets}
    streets = {street.id: _street_record(street, heights[street.id]) for street in plan.streets}
    road_ids, crosswalk_ids = count(_FIRST_CONNECTOR), count(_FIRST_CROSSWALK)
    signal_ids, controller_ids = count(_FIRST_SIGNAL), count(_FIRST_CONTROLLER)
    inner: list[RoadRecord] = []
    junctions: list[JunctionRecord] = []
    for junction in plan.junctions:
        arms = arms_of(junction, plan)
        heads = _heads(junction, arms, signal_ids)
        for arm, head in heads:
            record = streets[arm.street.id]
            streets[arm.street.id] = replace(record, signals=(*record.signals, head))
        by_arm = {arm: head.id for arm, head in heads}
        corners = [_corner(junction, a, b, next(road_ids)) for a, b in corner_pairs(arms)]
        roads = [
            _connector(junction, way, next(road_ids), by_arm.get(way.source))
            for way in movements(junction, arms)
        ]
        for arm in by_arm:
            roads = _with_crosswalk(roads, corners, arm, crosswalk_ids)
        inner += roads + corners
        junctions.append(
            JunctionRecord(
                id=junction.id,
                name=f"Junction {junction.id}",
                connections=tuple(_connection(road) for road in roads + corners),
                controllers=_controllers(junction, heads, controller_ids),
            )
        )
    origin = (plan.latitude, plan.longitude)
    return opendrive_text(plan.name, origin, [*streets.values(), *inner], junctions)


def arms_of(junction: Junction, plan: StreetPlan) -> list[Arm]:
    """The arms of a junction, in the order of the plan's streets."""
    arms = []
    for street in plan.streets:
        curve = street.curve()
        if street.start == junction.id:
            arms.append(Arm(street, "start", curve[0].start.reversed()))
        if street.end == junction.id:
            arms.append(Arm(street, "end", curve[-1].end))
    return arms


def movements(junction: Junction, arms: list[Arm]) -> Iterator[Movement]:
    """Every permitted way across: lane i goes straight on into lane i, the innermost lane also
    turns left into the innermost, and the outermost lane turns right into the outermost."""
    for source in arms:
        for target in arms:
            if target is source:
                continue
            turn = source.turn_to(target)
            n_from, n_to = source.street.section.lanes, target.street.section.lanes
            if abs(turn) < _STRAIGHT_RAD:
                yield Movement(source, target, Turn.STRAIGHT, 1, 1, min(n_from, n_to))
            elif turn < 0.0:
                yield Movement(source, target, Turn.RIGHT, n_from, n_to, 1)
            elif junction.left_turns:
                yield Movement(source, target, Turn.LEFT, 1, 1, 1)


def corner_pairs(arms: list[Arm]) -> list[tuple[Arm, Arm]]:
    """Neighbouring arms, each with the one to its right, where both have a sidewalk."""
    pairs = []
    for arm in arms:
        right = min((other for other in arms if other is not arm), key=arm.turn_to)
        if arm.street.section.sidewalk_m > 0.0 and right.street.section.sidewalk_m > 0.0:
            pairs.append((arm, right))
    return pairs


def _street_record(street: Street, elevation: Elevation) -> RoadRecord:
    strips = street.section.strips()
    return RoadRecord(
        id=street.id,
        name=f"Street {street.id}",
        junction=-1,
        curve=street.curve(),
        elevation=elevation,
        speed_kmh=street.section.speed_kmh,
        middle_line="none" if street.section.median_m > 0.0 else "solid solid yellow",
        left=strips,
        right=strips,
        predecessor=RoadEnd(kind="junction", id=street.start),
        successor=RoadEnd(kind="junction", id=street.end),
    )


Elevation = tuple[tuple[float, float, float, float, float], ...]
_FLAT: Elevation = ((0.0, 0.0, 0.0, 0.0, 0.0),)


def _elevation(street: Street) -> Elevation:
    """A smooth profile through the given heights that does not overshoot.

    Source: Fritsch, Butland: A method for constructing local monotone piecewise cubic
    interpolants, SIAM J. Sci. Stat. Comput. 1984 (slopes are harmonic means of neighbours').
    """
    points = street.profile
    slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(points)]
    tangents = [0.0]
    for before, after in pairwise(slopes):
        product = before * after
        tangents.append(2.0 * product / (before + after) if product > 0.0 else 0.0)
    tangents.append(0.0)
    rows = []
    for index, ((s, z), slope) in enumerate(zip(points, [*slopes, 0.0], strict=True)):
        if index + 1 == len(points):
            rows.append((s, z, 0.0, 0.0, 0.0))
            break
        step = points[index + 1][0] - s
        t0, t1 = tangents[index], tangents[index + 1]
        rows.append((s, z, t0, (3 * slope - 2 * t0 - t1) / step, (t0 + t1 - 2 * slope) / step**2))
    return tuple(rows)


def _connector(junction: Junction, way: Movement, road_id: int, head: int | None) -> RoadRecord:
    source, target = way.source, way.target
    start = source.inbound_edge(source.street.section.inner_edge_m(way.source_lane))
    end = target.outbound_edge(target.street.section.inner_edge_m(way.target_lane))
    lanes = range(way.lanes)
    strips = (Strip("driving", LANE_WIDTH_M, "none"),) * way.lanes
    references: tuple[ReferenceRecord, ...] = ()
    if head is not None:
        references = (ReferenceRecord(signal=head, station_m=0.5, first=-1, last=-way.lanes),)
    return RoadRecord(
        id=road_id,
        name=f"{way.turn.name.capitalize()} {source.street.id} to {target.street.id}",
        junction=junction.id,
        curve=curve_between(start, end),
        elevation=_FLAT,
        speed_kmh=source.street.section.speed_kmh,
        middle_line="none",
        left=(),
        right=strips,
        predecessor=RoadEnd(
            kind="road",
            id=source.street.id,
            contact=source.contact,
            lanes={-1 - i: source.lane_id(way.source_lane + i, inbound=True) for i in lanes},
        ),
        successor=RoadEnd(
            kind="road",
            id=target.street.id,
            contact=target.contact,
            lanes={-1 - i: target.lane_id(way.target_lane + i, inbound=False) for i in lanes},
        ),
        references=references,
    )


def _corner(junction: Junction, source: Arm, target: Arm, road_id: int) -> RoadRecord:
    """Shoulder, kerb and sidewalk round the corner from an arm to the one on its right."""
    verge = source.street.section.verge()
    curve = curve_between(
        source.inbound_edge(source.street.section.paved_m),
        target.outbound_edge(target.street.section.paved_m),
    )
    ends = []
    for arm, inbound in ((source, True), (target, False)):
        sign = arm.inbound_sign if inbound else -arm.inbound_sign
        first = len(arm.street.section.strips()) - len(verge) + 1
        lanes = {-1 - i: sign * (first + i) for i in range(len(verge))}
        ends.append(RoadEnd(kind="road", id=arm.street.id, contact=arm.contact, lanes=lanes))
    return RoadRecord(
        id=road_id,
        name=f"Corner {source.street.id} to {target.street.id}",
        junction=junction.id,
        curve=curve,
        elevation=_FLAT,
        speed_kmh=source.street.section.speed_kmh,
        middle_line="none",
        left=(),
        right=verge,
        predecessor=ends[0],
        successor=ends[1],
    )


def _connection(road: RoadRecord) -> tuple[int, int, tuple[tuple[int, int], ...]]:
    pairs = tuple((theirs, own) for own, theirs in road.predecessor.lanes.items())
    return road.predecessor.id, road.id, pairs


def _heads(
    junction: Junction, arms: list[Arm], signal_ids: Iterator[int]
) -> list[tuple[Arm, SignalRecord]]:
    """A light or stop sign at the right of every arm that has to heed one."""
    stem = max(arms, key=lambda arm: min(abs(arm.turn_to(o)) for o in arms if o is not arm))
    kind = LIGHT if junction.control is Control.LIGHTS else STOP
    heads = []
    for arm in arms:
        if junction.control is Control.STOP_STEM and arm is not stem:
            continue
        section = arm.street.section
        station = length_of(arm.street.curve()) - _SIGNAL_BEFORE_MOUTH_M
        right = section.paved_m + section.shoulder_m + section.kerb_m / 2.0
        head = SignalRecord(
            id=next(signal_ids),
            name=f"{'Light' if kind == LIGHT else 'Stop'} {junction.id} of {arm.street.id}",
            type=kind,
            station_m=station if arm.contact == "end" else _SIGNAL_BEFORE_MOUTH_M,
            left_m=right * arm.inbound_sign,
            sign=arm.inbound_sign,
        )
        heads.append((arm, head))
    return heads


def _controllers(
    junction: Junction, heads: list[tuple[Arm, SignalRecord]], ids: Iterator[int]
) -> tuple[tuple[int, tuple[int, ...]], ...]:
    """The light groups in the order of their turns: one an arm, but for those named together."""
    if junction.control is not Control.LIGHTS:
        return ()
    groups: dict[tuple[int, ...], list[int]] = {}
    for arm, head in heads:
        street = arm.street.id
        together = next((group for group in junction.one_phase if street in group), (street,))
        groups.setdefault(together, []).append(head.id)
    return tuple((next(ids), tuple(signals)) for signals in groups.values())


def _with_crosswalk(
    roads: list[RoadRecord], corners: list[RoadRecord], arm: Arm, ids: Iterator[int]
) -> list[RoadRecord]:
    """Adds the crosswalk over an arm's mouth, where both of its corners have a sidewalk."""
    right = next((road for road in corners if _leaves(road.predecessor, arm)), None)
    left = next((road for road in corners if _leaves(road.successor, arm)), None)
    if right is None or left is None:
        return roads
    index = next(i for i, road in enumerate(roads) if _starts_in_middle(road, arm))
    road = roads[index]
    station = _station_ahead(road.curve, arm.mouth, _CROSSWALK_AHEAD_M)
    pose = pose_at(road.curve, station)
    _, offset = arm.mouth.local(pose.x, pose.y)
    to_left = _sidewalk_left_of(left, arm.mouth) - offset
    to_right = _sidewalk_left_of(right, arm.mouth) - offset
    half = _CROSSWALK_WIDTH_M / 2.0
    walk = CrosswalkRecord(
        id=next(ids),
        station_m=station,
        heading_rad=wrapped(arm.mouth.heading + math.pi / 2.0 - pose.heading),
        outline=((to_left, half), (to_left, -half), (to_right, -half), (to_right, half)),
    )
    changed = replace(road, crosswalks=(*road.crosswalks, walk))
    return [*roads[:index], changed, *roads[index + 1 :]]


def _leaves(end: RoadEnd, arm: Arm) -> bool:
    return end.id == arm.street.id and end.contact == arm.contact


def _starts_in_middle(road: RoadRecord, arm: Arm) -> bool:
    innermost = arm.lane_id(1, inbound=True)
    return _leaves(road.predecessor, arm) and road.predecessor.lanes[-1] == innermost


def _station_ahead(curve: Curve, mouth: Pose, ahead_m: float) -> float:
    """The station at which a curve that starts at a mouth is `ahead_m` beyond it."""
    low, high = 0.0, length_of(curve)
    for _ in range(60):
        middle = 0.5 * (low + high)
        pose = pose_at(curve, middle)
        low, high = (middle, high) if mouth.local(pose.x, pose.y)[0] < ahead_m else (low, middle)
    return low


def _sidewalk_left_of(corner: RoadRecord, mouth: Pose) -> float:
    """How far left of a mouth's middle a corner's sidewalk passes the crosswalk [m]."""
    inside = sum(strip.width_m for strip in corner.right) - corner.right[-1].width_m / 2.0
    steps = range(101)
    poses = [pose_at(corner.curve, length_of(corner.curve) * i / 100.0) for i in steps]
    beside = [pose.shifted(0.0, -inside) for pose in poses]
    places = [mouth.local(pose.x, pose.y) for pose in beside]
    off = min(abs(ahead - _CROSSWALK_AHEAD_M) for ahead, _ in places)
    reached = [left for ahead, left in places if abs(ahead - _CROSSWALK_AHEAD_M) < off + 0.1]
    return min(reached, key=abs)
