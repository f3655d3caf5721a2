"""Reads OpenDRIVE XML into records, in OpenDRIVE's own frame and stations: syntax, no geometry.

Read is what CARLA's towns use of OpenDRIVE 1.4 to 1.8, and what others use to say the same: lanes
by borders, banked roads, direct junctions. Lane heights and lateral shapes are ignored, as CARLA
ignores them. What cannot be read rightly is refused by road and line of the file, not left out.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element

import numpy as np

from di_envs.town.reading.elements import (
    LONGEST_M,
    cubics,
    lane_number,
    line_of,
    named,
    number,
    parse_xml,
    refused,
    speed_limit,
    station,
    unique,
)
from di_envs.town.reading.lane_sections import COVER_M, sections_of
from di_envs.town.reading.records import (
    GEOMETRY_SHAPES,
    Connection,
    CrosswalkRecord,
    Float64,
    GeometryRecord,
    OpenDrive,
    RoadLink,
    RoadRecord,
    SignalRecord,
)

GEO_ORIGIN = (42.0, 2.0)  # CARLA's default where a map has no geoReference [deg]
_SHARPEST = 100.0  # 1/m: a bend of a centimetre's radius
_COVER_SHARE = 0.01  # of a road that its plan view may be shorter by, or COVER_M


def read_opendrive(text: str, source: str) -> OpenDrive:
    """Reads OpenDRIVE XML.

    Args:
        text: The file's content.
        source: What to call it in errors.

    Raises:
        ValueError: If it is no XML, no OpenDRIVE, or carries no roads, or a value is not readable.
    """
    root = _root(text, source)
    try:
        roads = unique(root.iterfind("road")).values()
        junctions = unique(root.iterfind("junction"))
        return OpenDrive(
            roads=tuple(_road(element) for element in roads),
            junctions={name: _connections(e) for name, e in junctions.items()},
            light_order=_light_order(root),
            geo_origin=_geo_origin(root),
        )
    except ValueError as error:
        raise ValueError(f"{source}: not readable as OpenDRIVE: {error}.") from error


def _root(text: str, source: str) -> Element:
    if not text.strip():
        raise ValueError(f"{source} is empty; expected an OpenDRIVE file (.xodr).")
    root = parse_xml(text, source)
    if root.tag != "OpenDRIVE":
        raise ValueError(
            f"{source} is XML but not OpenDRIVE: its root is <{root.tag}>, not <OpenDRIVE>."
        )
    return root


def _road(element: Element) -> RoadRecord:
    road_id = named(element)
    try:
        length = number(element, "length", least=0.0, most=LONGEST_M)
        junction = element.get("junction", "-1")
        speeds = (
            (station(e, "s", 0.0), speed_limit(e.find("speed"))) for e in element.iterfind("type")
        )
        return RoadRecord(
            road_id=road_id,
            line=line_of(element),
            length=length,
            junction=None if junction == "-1" else junction,
            right_hand=element.get("rule", "RHT") != "LHT",
            predecessor=_link(element.find("link/predecessor")),
            successor=_link(element.find("link/successor")),
            speeds=tuple(sorted((s, v) for s, v in speeds if v is not None)),
            geometry=_geometry(element, length),
            elevation=cubics(element.iterfind("elevationProfile/elevation")),
            superelevation=cubics(element.iterfind("lateralProfile/superelevation")),
            crossfall=(_crossfall(element, "left"), _crossfall(element, "right")),
            lane_offset=cubics(element.iterfind("lanes/laneOffset")),
            sections=sections_of(element, length),
            signals=_signals(element),
            crosswalks=_crosswalks(element),
        )
    except ValueError as error:
        raise ValueError(f"road '{road_id}', {error}") from error


def _crossfall(road: Element, side: str) -> Float64:
    """How a side of a road falls outwards [rad]; 1.4 and 1.5 have it."""
    falls = road.iterfind("lateralProfile/crossfall")
    return cubics(e for e in falls if e.get("side", "both") in (side, "both"))


def _link(element: Element | None) -> RoadLink | None:
    if element is None or element.get("elementId") is None:
        return None
    return RoadLink(
        is_junction=element.get("elementType") == "junction",
        element_id=element.get("elementId", ""),
        at_start=_at_start(element),
    )


def _at_start(element: Element) -> bool:
    contact = element.get("contactPoint", "start")
    if contact not in ("start", "end"):
        raise refused(element, f"contactPoint '{contact}' is unknown; known: start, end")
    return contact == "start"


def _geometry(road: Element, length: float) -> tuple[GeometryRecord, ...]:
    pieces = [
        GeometryRecord(
            shape=shape.tag,
            begin=station(e, "s"),
            length=number(e, "length", least=0.0, most=LONGEST_M),
            x=number(e, "x"),
            y=number(e, "y"),
            heading=number(e, "hdg"),
            parameters=_shape_parameters(shape),
        )
        for e in road.iterfind("planView/geometry")
        for shape in e
        if shape.tag in GEOMETRY_SHAPES
    ]
    if not pieces:
        raise refused(road, f"no geometry of a known shape ({', '.join(GEOMETRY_SHAPES)})")
    pieces.sort(key=lambda piece: piece.begin)
    _check_cover(road, pieces, length)
    return tuple(pieces)


def _check_cover(road: Element, pieces: list[GeometryRecord], length: float) -> None:
    """Refuses a plan view that leaves out a stretch of its road, where the road would stand still.

    Raises:
        ValueError: If it does by more than roundings do.
    """
    slack = max(COVER_M, _COVER_SHARE * length)
    covered = 0.0
    for begin, end in (*((p.begin, p.begin + p.length) for p in pieces), (length, length)):
        if begin > covered + slack:
            raise refused(
                road,
                f"its planView says nothing of stations {covered:g} to {begin:g} of {length:g} m; "
                "one of these lengths must be wrong",
            )
        covered = max(covered, end)


def _shape_parameters(shape: Element) -> tuple[float, ...]:
    if shape.tag == "line":
        return ()
    if shape.tag == "arc":
        return (_curvature(shape, "curvature"),)
    if shape.tag == "spiral":
        return (_curvature(shape, "curvStart"), _curvature(shape, "curvEnd"))
    if shape.tag == "poly3":
        return tuple(number(shape, c, 0.0) for c in ("a", "b", "c", "d"))
    names = [c + axis for axis in ("U", "V") for c in ("a", "b", "c", "d")]
    # The standard's default where pRange is absent is a parameter from 0 to 1.
    by_length = 1.0 if shape.get("pRange", "normalized") == "arcLength" else 0.0
    return (*(number(shape, name, 0.0) for name in names), by_length)


def _curvature(shape: Element, key: str) -> float:
    return number(shape, key, least=-_SHARPEST, most=_SHARPEST)


def _signals(road: Element) -> tuple[SignalRecord, ...]:
    return tuple(
        SignalRecord(
            signal_id=e.get("id", ""),
            is_reference=e.tag == "signalReference",
            type=e.get("type", ""),
            name=e.get("name", ""),
            s=number(e, "s", 0.0),
            t=number(e, "t", 0.0),
            z_offset=number(e, "zOffset", 0.0),
            orientation=e.get("orientation", "none"),
            validity=tuple(
                (lane_number(v, "fromLane", 0), lane_number(v, "toLane", 0))
                for v in e.iterfind("validity")
            ),
        )
        for parent in road.iterfind("signals")
        for e in parent
        if e.tag in ("signal", "signalReference")
    )


def _crosswalks(road: Element) -> tuple[CrosswalkRecord, ...]:
    records = []
    for e in road.iterfind("objects/object"):
        if e.get("type", "").lower() != "crosswalk":
            continue
        outline = e.find("outlines/outline")
        outline = e.find("outline") if outline is None else outline
        if outline is None:
            continue
        local = [[number(c, k, 0.0) for k in ("u", "v", "z")] for c in outline.iter("cornerLocal")]
        along = [[number(c, k, 0.0) for k in ("s", "t", "dz")] for c in outline.iter("cornerRoad")]
        records.append(
            CrosswalkRecord(
                s=number(e, "s", 0.0),
                t=number(e, "t", 0.0),
                heading=number(e, "hdg", 0.0),
                z_offset=number(e, "zOffset", 0.0),
                corners=np.array(local or along, dtype=np.float64).reshape(-1, 3),
                on_road=not local,
            )
        )
    return tuple(records)


def _connections(junction: Element) -> tuple[Connection, ...]:
    name, direct = named(junction), junction.get("type") == "direct"
    return tuple(
        Connection(
            junction=name,
            incoming_road=e.get("incomingRoad", ""),
            connecting_road=e.get("linkedRoad" if direct else "connectingRoad", ""),
            is_direct=direct,
            at_start=_at_start(e),
            lane_links=tuple(
                (lane_number(k, "from"), lane_number(k, "to")) for k in e.iterfind("laneLink")
            ),
        )
        for e in junction.iterfind("connection")
        if e.get("linkedRoad" if direct else "connectingRoad") is not None
    )


def _light_order(root: Element) -> dict[str, tuple[int, int]]:
    """Whose turn a signal has: its junction's sequence of controllers, then their place in it."""
    turns = {
        controller.get("id"): (int(number(controller, "sequence", 0.0)), place)
        for junction in root.iterfind("junction")
        for place, controller in enumerate(junction.iterfind("controller"))
    }
    return {
        control.get("signalId", ""): turns[controller.get("id")]
        for controller in root.iterfind("controller")
        if controller.get("id") in turns
        for control in controller.iterfind("control")
    }


def _geo_origin(root: Element) -> tuple[float, float]:
    element = root.find("header/geoReference")
    text = "" if element is None else (element.text or "")
    values = dict(part.lstrip("+").split("=", 1) for part in text.split() if "=" in part)
    try:
        latitude = float(values.get("lat_0", GEO_ORIGIN[0]))
        longitude = float(values.get("lon_0", GEO_ORIGIN[1]))
    except ValueError:
        latitude = longitude = float("nan")
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 360.0):
        assert element is not None  # the default is readable
        raise refused(element, f"geoReference '{text.strip()}' has an unreadable lat_0 or lon_0")
    return latitude, longitude
