"""Reads OpenDRIVE XML into records, in OpenDRIVE's own frame and stations: syntax, no geometry.

Read is what CARLA's towns use of OpenDRIVE 1.4 to 1.8. Superelevation and lane heights are ignored,
as CARLA ignores them when it places waypoints.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from xml.etree.ElementTree import Element

import numpy as np

from di_envs.town.lanes import LaneKind
from di_envs.town.reading.records import (
    GEOMETRY_SHAPES,
    Connection,
    CrosswalkRecord,
    Float64,
    GeometryRecord,
    LaneRecord,
    OpenDrive,
    RoadLink,
    RoadRecord,
    SectionRecord,
    SignalRecord,
)

GEO_ORIGIN = (42.0, 2.0)  # CARLA's default where a map has no geoReference [deg]
_LANE_KINDS = {
    "driving": LaneKind.DRIVING,
    "bidirectional": LaneKind.DRIVING,
    "parking": LaneKind.PARKING,
    "shoulder": LaneKind.SHOULDER,
    "sidewalk": LaneKind.SIDEWALK,
    "walking": LaneKind.SIDEWALK,
    "biking": LaneKind.BIKING,
}
_SPEED_UNITS_MPS = {None: 1.0, "m/s": 1.0, "mph": 0.44704, "km/h": 1.0 / 3.6}


def read_opendrive(text: str | bytes, source: str) -> OpenDrive:
    """Reads OpenDRIVE XML.

    Args:
        text: The file's content.
        source: What to call it in errors.

    Raises:
        ValueError: If it is no XML, no OpenDRIVE, or carries no roads, or a value is not readable.
    """
    root = _parse(text, source)
    try:
        roads = tuple(_road(element) for element in root.iterfind("road"))
        return OpenDrive(
            roads=roads,
            junctions={e.get("id", ""): _connections(e) for e in root.iterfind("junction")},
            light_order=_light_order(root),
            geo_origin=_geo_origin(root),
        )
    except (TypeError, ValueError, KeyError) as error:
        raise ValueError(f"{source}: not readable as OpenDRIVE: {error}.") from error


def _parse(text: str | bytes, source: str) -> Element:
    if not text.strip():
        raise ValueError(f"{source} is empty; expected an OpenDRIVE file (.xodr).")
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise ValueError(
            f"{source} is not well-formed XML ({error}); expected an OpenDRIVE file (.xodr)."
        ) from error
    if root.tag.startswith("{"):  # 1.8 files may declare a namespace
        for element in root.iter():
            element.tag = element.tag.rpartition("}")[2]
    if root.tag != "OpenDRIVE":
        raise ValueError(
            f"{source} is XML but not OpenDRIVE: its root is <{root.tag}>, not <OpenDRIVE>."
        )
    return root


def _number(element: Element, key: str, default: float | None = None) -> float:
    value = element.get(key)
    if value is None:
        if default is None:
            raise ValueError(f"<{element.tag}> has no attribute '{key}'")
        return default
    try:
        return float(value)
    except ValueError:
        raise ValueError(f"<{element.tag} {key}='{value}'> is not a number") from None


def _cubics(elements: Iterable[Element], key: str = "s", base: float = 0.0) -> Float64:
    rows = [
        [base + _number(e, key, 0.0), *(_number(e, c, 0.0) for c in ("a", "b", "c", "d"))]
        for e in elements
    ]
    table = np.array(rows or [[base, 0.0, 0.0, 0.0, 0.0]])
    return table[np.argsort(table[:, 0], kind="stable")]


def _speed(element: Element | None) -> float | None:
    if element is None or element.get("max") in (None, "no limit", "undefined"):
        return None
    unit = element.get("unit")
    if unit not in _SPEED_UNITS_MPS:
        known = ", ".join(u for u in _SPEED_UNITS_MPS if u)
        raise ValueError(f"speed unit '{unit}' is unknown; known: {known}")
    return _number(element, "max") * _SPEED_UNITS_MPS[unit]


def _road(element: Element) -> RoadRecord:
    road_id = element.get("id", "")
    try:
        length = _number(element, "length")
        junction = element.get("junction", "-1")
        speeds = ((_number(e, "s", 0.0), _speed(e.find("speed"))) for e in element.iterfind("type"))
        return RoadRecord(
            road_id=road_id,
            length=length,
            junction=None if junction == "-1" else junction,
            right_hand=element.get("rule", "RHT") != "LHT",
            predecessor=_link(element.find("link/predecessor")),
            successor=_link(element.find("link/successor")),
            speeds=tuple(sorted((s, v) for s, v in speeds if v is not None)),
            geometry=_geometry(element),
            elevation=_cubics(element.iterfind("elevationProfile/elevation")),
            lane_offset=_cubics(element.iterfind("lanes/laneOffset")),
            sections=_sections(element, length),
            signals=_signals(element),
            crosswalks=_crosswalks(element),
        )
    except ValueError as error:
        raise ValueError(f"road '{road_id}': {error}") from error


def _link(element: Element | None) -> RoadLink | None:
    if element is None or element.get("elementId") is None:
        return None
    return RoadLink(
        is_junction=element.get("elementType") == "junction",
        element_id=element.get("elementId", ""),
        at_start=element.get("contactPoint", "start") == "start",
    )


def _geometry(road: Element) -> tuple[GeometryRecord, ...]:
    pieces = [
        GeometryRecord(
            shape=shape.tag,
            begin=_number(e, "s"),
            length=_number(e, "length"),
            x=_number(e, "x"),
            y=_number(e, "y"),
            heading=_number(e, "hdg"),
            parameters=_shape_parameters(shape),
        )
        for e in road.iterfind("planView/geometry")
        for shape in e
        if shape.tag in GEOMETRY_SHAPES
    ]
    if not pieces:
        raise ValueError(f"no geometry of a known shape ({', '.join(GEOMETRY_SHAPES)})")
    return tuple(sorted(pieces, key=lambda piece: piece.begin))


def _shape_parameters(shape: Element) -> tuple[float, ...]:
    if shape.tag == "line":
        return ()
    if shape.tag == "arc":
        return (_number(shape, "curvature"),)
    if shape.tag == "spiral":
        return (_number(shape, "curvStart"), _number(shape, "curvEnd"))
    if shape.tag == "poly3":
        return tuple(_number(shape, c, 0.0) for c in ("a", "b", "c", "d"))
    names = [c + axis for axis in ("U", "V") for c in ("a", "b", "c", "d")]
    # The standard's default where pRange is absent is a parameter from 0 to 1.
    by_length = 1.0 if shape.get("pRange", "normalized") == "arcLength" else 0.0
    return (*(_number(shape, name, 0.0) for name in names), by_length)


def _sections(road: Element, length: float) -> tuple[SectionRecord, ...]:
    elements = sorted(road.iterfind("lanes/laneSection"), key=lambda e: _number(e, "s", 0.0))
    begins = [_number(e, "s", 0.0) for e in elements]
    ends = [*begins[1:], max(length, begins[-1] if begins else 0.0)]
    return tuple(
        SectionRecord(
            begin=begin,
            end=end,
            lanes={
                lane.lane_id: lane
                for side in ("left", "center", "right")
                for lane in (_lane(e, begin) for e in element.iterfind(f"{side}/lane"))
            },
        )
        for element, begin, end in zip(elements, begins, ends, strict=True)
    )


def _lane(element: Element, base: float) -> LaneRecord:
    lane_id = int(element.get("id", "0"))
    if element.find("border") is not None and element.find("width") is None:
        raise ValueError(f"lane {lane_id} has <border>s; only <width> is read")
    speeds = ((base + _number(e, "sOffset", 0.0), _speed(e)) for e in element.iterfind("speed"))
    return LaneRecord(
        lane_id=lane_id,
        kind=_LANE_KINDS.get(element.get("type", ""), LaneKind.OTHER),
        widths=_cubics(element.iterfind("width"), "sOffset", base),
        predecessors=tuple(int(e.get("id", "0")) for e in element.iterfind("link/predecessor")),
        successors=tuple(int(e.get("id", "0")) for e in element.iterfind("link/successor")),
        marks=tuple(_mark(e, base) for e in element.iterfind("roadMark")),
        speeds=tuple(sorted((s, v) for s, v in speeds if v is not None)),
    )


def _mark(element: Element, base: float) -> tuple[float, bool, bool]:
    """Where a mark begins and which ways it may be crossed; broken lines where it does not say."""
    allowed = element.get("laneChange")
    if allowed is None:
        allowed = "both" if element.get("type", "none") in ("broken", "broken broken") else "none"
    up, down = allowed in ("both", "increase"), allowed in ("both", "decrease")
    return base + _number(element, "sOffset", 0.0), up, down


def _signals(road: Element) -> tuple[SignalRecord, ...]:
    return tuple(
        SignalRecord(
            signal_id=e.get("id", ""),
            is_reference=e.tag == "signalReference",
            type=e.get("type", ""),
            name=e.get("name", ""),
            s=_number(e, "s", 0.0),
            t=_number(e, "t", 0.0),
            z_offset=_number(e, "zOffset", 0.0),
            orientation=e.get("orientation", "none"),
            validity=tuple(
                (int(v.get("fromLane", "0")), int(v.get("toLane", "0")))
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
        local = [[_number(c, k, 0.0) for k in ("u", "v", "z")] for c in outline.iter("cornerLocal")]
        along = [[_number(c, k, 0.0) for k in ("s", "t", "dz")] for c in outline.iter("cornerRoad")]
        records.append(
            CrosswalkRecord(
                s=_number(e, "s", 0.0),
                t=_number(e, "t", 0.0),
                heading=_number(e, "hdg", 0.0),
                z_offset=_number(e, "zOffset", 0.0),
                corners=np.array(local or along, dtype=np.float64).reshape(-1, 3),
                on_road=not local,
            )
        )
    return tuple(records)


def _connections(junction: Element) -> tuple[Connection, ...]:
    return tuple(
        Connection(
            incoming_road=e.get("incomingRoad", ""),
            connecting_road=e.get("connectingRoad", ""),
            at_start=e.get("contactPoint", "start") == "start",
            lane_links=tuple(
                (int(k.get("from", "0")), int(k.get("to", "0"))) for k in e.iterfind("laneLink")
            ),
        )
        for e in junction.iterfind("connection")
        if e.get("connectingRoad") is not None
    )


def _light_order(root: Element) -> dict[str, tuple[int, int]]:
    """Whose turn a signal has: its junction's sequence of controllers, then their place in it."""
    turns = {
        controller.get("id"): (int(_number(controller, "sequence", 0.0)), place)
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
    text = root.findtext("header/geoReference") or ""
    values = dict(part.lstrip("+").split("=", 1) for part in text.split() if "=" in part)
    try:
        latitude = float(values.get("lat_0", GEO_ORIGIN[0]))
        longitude = float(values.get("lon_0", GEO_ORIGIN[1]))
    except ValueError:
        raise ValueError(
            f"geoReference '{text.strip()}' has an unreadable lat_0 or lon_0"
        ) from None
    return latitude, longitude
