"""Turns a street plan into road records: streets, ways across junctions, corners.

Each way across a junction is a road of its own with its lanes on the right, driven from start to
end. Frame: OpenDRIVE's, x east, y north, angles counter-clockwise.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import count, pairwise

from di_envs.town.building.alignment import curve_between
from di_envs.town.building.junction_arms import (
    Movement,
    StreetEnd,
    arms_of,
    corner_pairs,
    movements,
)
from di_envs.town.building.opendrive_writer import (
    JunctionDraft,
    ReferenceDraft,
    RoadDraft,
    RoadEnd,
    opendrive_text,
)
from di_envs.town.building.roadside import controllers_of, heads_of, with_crosswalk
from di_envs.town.building.street_plan import LANE_WIDTH_M, Junction, Street, StreetPlan, Strip

_FIRST_CONNECTOR = 2000  # ids of roads inside junctions start here,
_FIRST_CROSSWALK = 5000  # those of crosswalks here,
_FIRST_SIGNAL = 6000  # those of signals here,
_FIRST_CONTROLLER = 7000  # and those of controllers here

Elevation = tuple[tuple[float, float, float, float, float], ...]
_FLAT: Elevation = ((0.0, 0.0, 0.0, 0.0, 0.0),)


def town_text(plan: StreetPlan) -> str:
    """The OpenDRIVE text of a street plan."""
    heights = {street.id: _elevation(street) for street in plan.streets}
    streets = {street.id: _street_record(street, heights[street.id]) for street in plan.streets}
    road_ids, crosswalk_ids = count(_FIRST_CONNECTOR), count(_FIRST_CROSSWALK)
    signal_ids, controller_ids = count(_FIRST_SIGNAL), count(_FIRST_CONTROLLER)
    inner: list[RoadDraft] = []
    junctions: list[JunctionDraft] = []
    for junction in plan.junctions:
        arms = arms_of(junction, plan)
        heads = heads_of(junction, arms, signal_ids)
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
            roads = with_crosswalk(roads, corners, arm, crosswalk_ids)
        inner += roads + corners
        junctions.append(
            JunctionDraft(
                id=junction.id,
                name=f"Junction {junction.id}",
                connections=tuple(_connection(road) for road in roads + corners),
                controllers=controllers_of(junction, heads, controller_ids),
            )
        )
    origin = (plan.latitude, plan.longitude)
    return opendrive_text(plan.name, origin, [*streets.values(), *inner], junctions)


def _street_record(street: Street, elevation: Elevation) -> RoadDraft:
    strips = street.section.strips()
    return RoadDraft(
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


def _connector(junction: Junction, way: Movement, road_id: int, head: int | None) -> RoadDraft:
    source, target = way.source, way.target
    start = source.inbound_edge(source.street.section.inner_edge_m(way.source_lane))
    end = target.outbound_edge(target.street.section.inner_edge_m(way.target_lane))
    lanes = range(way.lanes)
    strips = (Strip("driving", LANE_WIDTH_M, "none"),) * way.lanes
    slower_kmh = min(source.street.section.speed_kmh, target.street.section.speed_kmh)
    references: tuple[ReferenceDraft, ...] = ()
    if head is not None:
        references = (ReferenceDraft(signal=head, station_m=0.5, first=-1, last=-way.lanes),)
    return RoadDraft(
        id=road_id,
        name=f"{way.turn.name.capitalize()} {source.street.id} to {target.street.id}",
        junction=junction.id,
        curve=curve_between(start, end),
        elevation=_FLAT,
        speed_kmh=slower_kmh,
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


def _corner(junction: Junction, source: StreetEnd, target: StreetEnd, road_id: int) -> RoadDraft:
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
    return RoadDraft(
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


def _connection(road: RoadDraft) -> tuple[int, int, tuple[tuple[int, int], ...]]:
    pairs = tuple((theirs, own) for own, theirs in road.predecessor.lanes.items())
    return road.predecessor.id, road.id, pairs
