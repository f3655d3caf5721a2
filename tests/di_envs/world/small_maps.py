"""Small towns drawn at random: two or three junctions in a row, roads of 1 to 30 m between them.

Their other arms lead out of the town: roads that end openly. Junctions have 2 to 6 arms, roads one
to three lanes a direction; a left-hand town is a right-hand one seen in a mirror. OpenDRIVE's
frame: x east, y north [m].
"""

from __future__ import annotations

import math
import random
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field

from di_envs.town.building.alignment import Curve, Pose, curve_between, length_of
from di_envs.town.building.junction_arms import Movement, StreetEnd, movements
from di_envs.town.building.opendrive_writer import (
    JunctionDraft,
    RoadDraft,
    RoadEnd,
    opendrive_text,
)
from di_envs.town.building.street_plan import (
    LANE_WIDTH_M,
    Control,
    CrossSection,
    Junction,
    Street,
    Strip,
)

OPEN = -1  # where a street leads out of the town
_SPARE_M = 12.0  # of a junction's radius, beyond what its arms' widths need
_FIRST_WAY = 100  # ids of the roads inside junctions start here
_OUTER_DEG = (90, 135, 180, 225, 270)  # of arms that lead out, from the direction to a neighbour
_FLAT = ((0.0, 0.0, 0.0, 0.0, 0.0),)


@dataclass(kw_only=True)
class _Place:
    """A junction that is being drawn: its middle, and directions of its arms [rad]."""

    id: int
    x: float
    radius_m: float
    outer: tuple[float, ...]
    arms: list[StreetEnd] = field(default_factory=list)

    def mouth(self, direction: float) -> Pose:
        """The middle of an arm, heading into the junction."""
        c, s = math.cos(direction), math.sin(direction)
        return Pose(self.x + self.radius_m * c, self.radius_m * s, direction + math.pi)


def small_map(seed: int) -> str:
    """The OpenDRIVE text of a small town; odd seeds drive on the left."""
    draw = random.Random(seed)
    places = list(_places(draw))
    streets = [street for k in range(len(places)) for street in _streets(draw, places, k)]
    roads = [_street_road(street) for street in streets]
    junctions = []
    for place in places:
        ways = list(_ways(place, _FIRST_WAY * place.id))
        roads += ways
        junctions.append(
            JunctionDraft(id=place.id, name="", connections=_connections(ways), controllers=())
        )
    text = opendrive_text(f"small{seed}", (0.0, 0.0), roads, junctions)
    return _finished(text, mirrored=seed % 2 == 1)


def _places(draw: random.Random) -> Iterator[_Place]:
    count, end = draw.choice((2, 2, 3)), 0.0
    lanes = draw.randint(1, 3)
    radius = _SPARE_M + 2.4 * lanes * LANE_WIDTH_M
    for k in range(count):
        inner = 0 < k < count - 1
        choices = (90, 270) if inner else _OUTER_DEG
        outer = draw.sample(choices, draw.randint(0 if inner else 1, len(choices)))
        turn = 180 if k == count - 1 else 0
        between = draw.choice((draw.uniform(1.0, 5.0), draw.uniform(5.0, 30.0)))
        yield _Place(
            id=k + 1,
            x=end + radius,
            radius_m=radius,
            outer=tuple(math.radians(turn + degrees) for degrees in sorted(outer)),
        )
        end += 2.0 * radius + between
        lanes = draw.randint(1, lanes)


def _streets(draw: random.Random, places: list[_Place], k: int) -> Iterator[Street]:
    """The streets that lead out of a junction, and the one to the next; noted as their arms."""
    place = places[k]
    most = round((place.radius_m - _SPARE_M) / (2.4 * LANE_WIDTH_M))
    for number, direction in enumerate(place.outer):
        length = draw.uniform(30.0, 80.0)
        start = place.mouth(direction)
        yield _joined(draw, most, 10 * place.id + number, start, length, place, None)
    if k + 1 < len(places):
        start, end = place.mouth(0.0), places[k + 1].mouth(math.pi)
        length = end.x - start.x
        yield _joined(draw, most, 10 * place.id + 9, start, length, place, places[k + 1])


def _joined(
    draw: random.Random,
    most: int,
    street_id: int,
    mouth: Pose,
    length_m: float,
    place: _Place,
    other: _Place | None,
) -> Street:
    far = mouth.shifted(-length_m, 0.0)
    street = Street(
        id=street_id,
        section=CrossSection(
            lanes=draw.randint(1, most),
            speed_kmh=draw.choice((30.0, 50.0)),
            shoulder_m=0.0,
            kerb_m=0.0,
            sidewalk_m=0.0,
        ),
        start=place.id,
        end=other.id if other else OPEN,
        points=((mouth.x, mouth.y, 0.0), (far.x, far.y, 0.0)),
    )
    place.arms.append(StreetEnd(street, "start", mouth))
    if other:
        other.arms.append(StreetEnd(street, "end", far.reversed()))
    return street


def _street_road(street: Street) -> RoadDraft:
    return RoadDraft(
        id=street.id,
        name="",
        junction=-1,
        curve=street.curve(),
        elevation=_FLAT,
        speed_kmh=street.section.speed_kmh,
        middle_line="solid",
        left=street.section.strips(),
        right=street.section.strips(),
        predecessor=RoadEnd(kind="junction", id=street.start),
        successor=RoadEnd(kind="junction", id=street.end),
    )


def _ways(place: _Place, first_id: int) -> Iterator[RoadDraft]:
    junction = Junction(id=place.id, control=Control.STOP_ALL)
    for way in movements(junction, place.arms):
        source, target = way.source, way.target
        curve = curve_between(
            source.inbound_edge(source.street.section.inner_edge_m(way.source_lane)),
            target.outbound_edge(target.street.section.inner_edge_m(way.target_lane)),
        )
        yield _way_road(place, way, curve, first_id)
        first_id += 1


def _way_road(place: _Place, way: Movement, curve: Curve, road_id: int) -> RoadDraft:
    source, target = way.source, way.target
    lanes = range(way.lanes)
    return RoadDraft(
        id=road_id,
        name="",
        junction=place.id,
        curve=curve,
        elevation=_FLAT,
        speed_kmh=30.0,
        middle_line="none",
        left=(),
        right=(Strip("driving", LANE_WIDTH_M, "none"),) * way.lanes,
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
    )


def _connections(
    ways: list[RoadDraft],
) -> tuple[tuple[int, int, tuple[tuple[int, int], ...]], ...]:
    return tuple(
        (road.predecessor.id, road.id, tuple((b, a) for a, b in road.predecessor.lanes.items()))
        for road in ways
        if length_of(road.curve) > 0.0
    )


def _finished(text: str, *, mirrored: bool) -> str:
    """Takes away the links of open ends, and turns right to left if that is wanted."""
    top = ET.fromstring(text)
    for link in top.iterfind("road/link"):
        for row in list(link):
            if row.get("elementId") == str(OPEN):
                link.remove(row)
    if mirrored:
        _mirror(top)
    return ET.tostring(top, encoding="unicode")


def _mirror(top: ET.Element) -> None:
    """Turns y, headings and curvatures round, and so left lanes to right ones."""
    for road in top.iterfind("road"):
        road.set("rule", "LHT")
        for row in road.iterfind("planView/geometry"):
            _negate(row, "y", "hdg")
        for row in road.iterfind("planView/geometry/arc"):
            _negate(row, "curvature")
        for section in road.iterfind("lanes/laneSection"):
            left, right = section.find("left"), section.find("right")
            for side, name in ((left, "right"), (right, "left")):
                if side is not None:
                    side.tag = name
                    side[:] = side[::-1]
            section[:] = sorted(section, key=lambda e: ("left", "center", "right").index(e.tag))
            for lane in section.iterfind("*/lane"):
                _negate(lane, "id")
                for row in lane.iterfind("link/*"):
                    _negate(row, "id")
    for row in top.iterfind("junction/connection/laneLink"):
        _negate(row, "from", "to")


def _negate(row: ET.Element, *names: str) -> None:
    for name in names:
        value = row.get(name, "0")
        row.set(name, "0" if float(value) == 0.0 else value[1:] if value[0] == "-" else f"-{value}")
