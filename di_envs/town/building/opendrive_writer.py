"""Writes OpenDRIVE 1.4 text from plain records of roads and junctions.

Records hold what the file says and nothing else; who computes them is `junction_layout`. Numbers
are rounded to the micrometre, so the text does not depend on a processor's last bit.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, field

from di_envs.town.building.alignment import Curve, length_of
from di_envs.town.building.street_plan import Strip


@dataclass(frozen=True, kw_only=True)
class RoadEnd:
    """What a road joins at one of its ends."""

    kind: str  # "road" or "junction"
    id: int
    contact: str = ""  # "start" or "end" of a road
    lanes: dict[int, int] = field(default_factory=dict)  # own lane id -> its lane id


@dataclass(frozen=True, kw_only=True)
class SignalDraft:
    """A traffic light (1000001) or stop sign (206) beside a road, for traffic along its `sign`."""

    id: int
    name: str
    type: str
    station_m: float
    left_m: float
    sign: int  # -1: for the traffic of the right lanes, 1: for that of the left lanes


@dataclass(frozen=True, kw_only=True)
class ReferenceDraft:
    """Says that a signal elsewhere rules this road's lanes `first` to `last`."""

    signal: int
    station_m: float
    first: int
    last: int


@dataclass(frozen=True, kw_only=True)
class CrosswalkDraft:
    """A zebra crossing; `outline` in its own frame: u along its heading, v to the left [m]."""

    id: int
    station_m: float
    heading_rad: float  # relative to the road
    outline: tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class RoadDraft:
    """A road to be written, with one lane section."""

    id: int
    name: str
    junction: int  # -1 outside junctions
    curve: Curve
    elevation: tuple[tuple[float, float, float, float, float], ...]  # s, a, b, c, d
    speed_kmh: float
    middle_line: str
    left: tuple[Strip, ...]  # from the middle outwards
    right: tuple[Strip, ...]
    predecessor: RoadEnd
    successor: RoadEnd
    signals: tuple[SignalDraft, ...] = ()
    references: tuple[ReferenceDraft, ...] = ()
    crosswalks: tuple[CrosswalkDraft, ...] = ()


@dataclass(frozen=True, kw_only=True)
class JunctionDraft:
    """A junction: connections are (incoming road, connecting road, lane pairs)."""

    id: int
    name: str
    connections: tuple[tuple[int, int, tuple[tuple[int, int], ...]], ...]
    controllers: tuple[tuple[int, tuple[int, ...]], ...]  # id, its signals, in the order of turns


def opendrive_text(
    name: str,
    origin: tuple[float, float],
    roads: Sequence[RoadDraft],
    junctions: Sequence[JunctionDraft],
) -> str:
    """The text of an OpenDRIVE file.

    Args:
        name: Name of the town.
        origin: Latitude and longitude of x = y = 0 [deg].
        roads: All roads, those inside junctions too.
        junctions: All junctions.
    """
    top = ET.Element("OpenDRIVE")
    _header(top, name, origin, roads)
    for road in roads:
        _road(top, road)
    for junction in junctions:
        for sequence, (controller, signals) in enumerate(junction.controllers):
            row = _add(top, "controller", name=f"Group {controller}", id=controller)
            row.set("sequence", str(sequence))
            for signal in signals:
                _add(row, "control", signalId=signal, type="")
    for junction in junctions:
        _junction(top, junction)
    ET.indent(top, " ")
    body = ET.tostring(top, encoding="unicode", short_empty_elements=True)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'


def _add(parent: ET.Element, tag: str, **attributes: float | str) -> ET.Element:
    return ET.SubElement(parent, tag, {key: _text(value) for key, value in attributes.items()})


def _text(value: float | str, digits: int = 6) -> str:
    if not isinstance(value, float):
        return str(value)
    short = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if short == "-0" else short


def _header(
    top: ET.Element, name: str, origin: tuple[float, float], roads: Sequence[RoadDraft]
) -> None:
    poses = [pose for road in roads for piece in road.curve for pose in (piece.start, piece.end)]
    header = _add(top, "header", revMajor=1, revMinor=4, name=name, version="1.00")
    header.set("north", _text(max(pose.y for pose in poses), 1))
    header.set("south", _text(min(pose.y for pose in poses), 1))
    header.set("east", _text(max(pose.x for pose in poses), 1))
    header.set("west", _text(min(pose.x for pose in poses), 1))
    header.set("vendor", "DriveInsight")
    reference = _add(header, "geoReference")
    reference.text = (
        f"+proj=tmerc +lat_0={_text(origin[0])} +lon_0={_text(origin[1])} +k=1 +x_0=0 +y_0=0 "
        "+datum=WGS84 +units=m +no_defs"
    )


def _road(top: ET.Element, road: RoadDraft) -> None:
    element = _add(
        top,
        "road",
        name=road.name,
        length=length_of(road.curve),
        id=road.id,
        junction=road.junction,
    )
    link = _add(element, "link")
    for tag, end in (("predecessor", road.predecessor), ("successor", road.successor)):
        row = _add(link, tag, elementType=end.kind, elementId=end.id)
        if end.contact:
            row.set("contactPoint", end.contact)
    kind = _add(element, "type", s=0, type="town")
    _add(kind, "speed", max=road.speed_kmh, unit="km/h")
    _plan_view(element, road.curve)
    profile = _add(element, "elevationProfile")
    for s, a, b, c, d in road.elevation:
        row = _add(profile, "elevation", s=s, a=a)
        for key, value in (("b", b), ("c", c), ("d", d)):
            row.set(key, _text(value, 12))
    _lanes(element, road)
    _objects(element, road)
    _signals(element, road)


def _plan_view(element: ET.Element, curve: Curve) -> None:
    view = _add(element, "planView")
    station = 0.0
    for piece in curve:
        row = _add(view, "geometry", s=station, x=piece.start.x, y=piece.start.y)
        row.set("hdg", _text(piece.start.heading, 9))
        row.set("length", _text(piece.length_m))
        if piece.curvature_per_m == 0.0:
            _add(row, "line")
        else:
            _add(row, "arc").set("curvature", _text(piece.curvature_per_m, 10))
        station += piece.length_m


def _lanes(element: ET.Element, road: RoadDraft) -> None:
    lanes = _add(element, "lanes")
    _add(lanes, "laneOffset", s=0, a=0, b=0, c=0, d=0)
    section = _add(lanes, "laneSection", s=0)
    if road.left:
        left = _add(section, "left")
        for number in range(len(road.left), 0, -1):
            _lane(left, number, road.left[number - 1], road)
    middle = _add(_add(section, "center"), "lane", id=0, type="none", level="false")
    _road_mark(middle, road.middle_line)
    if road.right:
        right = _add(section, "right")
        for number, strip in enumerate(road.right, start=1):
            _lane(right, -number, strip, road)


def _lane(side: ET.Element, lane_id: int, strip: Strip, road: RoadDraft) -> None:
    lane = _add(side, "lane", id=lane_id, type=strip.kind, level="false")
    link = _add(lane, "link")
    for tag, end in (("predecessor", road.predecessor), ("successor", road.successor)):
        if lane_id in end.lanes:
            _add(link, tag, id=end.lanes[lane_id])
    if len(link) == 0:
        lane.remove(link)
    _add(lane, "width", sOffset=0, a=strip.width_m, b=0, c=0, d=0)
    _road_mark(lane, strip.line)


def _road_mark(lane: ET.Element, line: str) -> None:
    """Writes a line such as "broken" or "solid yellow"; only broken lines may be crossed."""
    kind = line.removesuffix(" yellow")
    mark = _add(lane, "roadMark", sOffset=0, type=kind, material="standard")
    mark.set("color", "yellow" if line != kind else "white")
    mark.set("width", "0.15")
    mark.set("laneChange", "both" if kind == "broken" else "none")


def _objects(element: ET.Element, road: RoadDraft) -> None:
    if not road.crosswalks:
        return
    objects = _add(element, "objects")
    for walk in road.crosswalks:
        row = _add(objects, "object", id=walk.id, name="Crosswalk", type="crosswalk")
        for key, value in (("s", walk.station_m), ("t", 0.0), ("zOffset", 0.0)):
            row.set(key, _text(value))
        row.set("hdg", _text(walk.heading_rad, 9))
        for key in ("pitch", "roll"):
            row.set(key, "0")
        row.set("orientation", "none")
        us, vs = zip(*walk.outline, strict=True)
        row.set("length", _text(max(us) - min(us)))
        row.set("width", _text(max(vs) - min(vs)))
        outline = _add(row, "outline")
        for u, v in (*walk.outline, walk.outline[0]):
            _add(outline, "cornerLocal", u=u, v=v, z=0)


def _signals(element: ET.Element, road: RoadDraft) -> None:
    if not road.signals and not road.references:
        return
    signals = _add(element, "signals")
    for signal in road.signals:
        row = _add(signals, "signal", name=signal.name, id=signal.id)
        row.set("s", _text(signal.station_m))
        row.set("t", _text(signal.left_m))
        row.set("zOffset", "0")
        # CARLA's towns: a head faces the traffic of right lanes as "-" with no turn, and that of
        # left lanes as "+" turned by half a circle
        row.set("hOffset", "0" if signal.sign < 0 else "3.141592654")
        row.set("roll", "0")
        row.set("pitch", "0")
        row.set("orientation", "-" if signal.sign < 0 else "+")
        row.set("dynamic", "yes" if signal.type == "1000001" else "no")
        row.set("country", "OpenDRIVE")
        row.set("type", signal.type)
        row.set("subtype", "-1")
        row.set("value", "-1")
        row.set("text", "")
        row.set("height", "1")
        row.set("width", "0.5")
        _add(row, "validity", fromLane=0, toLane=0)
    for reference in road.references:
        row = _add(signals, "signalReference", id=reference.signal)
        row.set("s", _text(reference.station_m))
        row.set("t", "0")
        row.set("orientation", "-" if reference.first < 0 else "+")
        _add(row, "validity", fromLane=reference.first, toLane=reference.last)


def _junction(top: ET.Element, junction: JunctionDraft) -> None:
    element = _add(top, "junction", id=junction.id, name=junction.name)
    for number, (incoming, connecting, pairs) in enumerate(junction.connections):
        row = _add(element, "connection", id=number, incomingRoad=incoming)
        row.set("connectingRoad", str(connecting))
        row.set("contactPoint", "start")
        for begin, end in pairs:
            _add(row, "laneLink").attrib.update({"from": str(begin), "to": str(end)})
    for sequence, (controller, _) in enumerate(junction.controllers):
        _add(element, "controller", id=controller, type=0, sequence=sequence)
