"""Reads lane sections of OpenDRIVE: the kind, widths, links, marks and speeds of each lane."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from di_envs.town.lanes import LaneKind
from di_envs.town.reading.borders import NOTHING, summed
from di_envs.town.reading.elements import (
    cubics,
    lane_number,
    number,
    refused,
    speed_limit,
    station,
    unique,
)
from di_envs.town.reading.records import Float64, LaneRecord, SectionRecord

COVER_M = 1.0  # that a plan view may be shorter than its road by, and a section begin behind it
_LANE_KINDS = {
    "driving": LaneKind.DRIVING,
    "bidirectional": LaneKind.DRIVING,
    "parking": LaneKind.PARKING,
    "shoulder": LaneKind.SHOULDER,
    "sidewalk": LaneKind.SIDEWALK,
    "walking": LaneKind.SIDEWALK,
    "biking": LaneKind.BIKING,
}
_SIDES = ("left", "center", "right")
_BORDERS_CROSS_M = 0.01  # that a border may lie within the one before it by


def sections_of(road: Element, length: float) -> tuple[SectionRecord, ...]:
    elements = sorted(road.iterfind("lanes/laneSection"), key=lambda e: station(e, "s", 0.0))
    if not elements:
        raise refused(road, "it has no lane sections; a road needs one <laneSection> at least")
    begins = [station(e, "s", 0.0) for e in elements]
    if begins[-1] > length + COVER_M:
        raise refused(
            elements[-1], f"<laneSection s='{begins[-1]:g}'> begins behind the road's {length:g} m"
        )
    ends = [*begins[1:], max(length, begins[-1])]
    shifted = bool(cubics(road.iterfind("lanes/laneOffset"))[:, 1:].any())
    return tuple(
        SectionRecord(begin=begin, end=end, lanes=_lanes(element, begin, shifted))
        for element, begin, end in zip(elements, begins, ends, strict=True)
    )


def _lanes(section: Element, begin: float, shifted: bool) -> dict[int, LaneRecord]:
    """The lanes of a section by id, from the left to the right of the file's sides."""
    elements = unique(e for side in _SIDES for e in section.iterfind(f"{side}/lane"))
    by_id = {lane_number(e, "id"): e for e in elements.values()}
    if len(by_id) < len(elements):
        raise refused(section, f"two of its lanes have one id: {', '.join(elements)}")
    if shifted and any(_has_border(e) for e in by_id.values()):
        raise refused(
            section,
            "its lanes have <border>s and its road a <laneOffset>: which of them moves a lane is "
            "not defined; give <width>s",
        )
    widths = _widths(by_id, begin)
    return {lane_id: _lane(e, lane_id, widths[lane_id], begin) for lane_id, e in by_id.items()}


def _has_border(lane: Element) -> bool:
    return lane.find("border") is not None and lane.find("width") is None


def _widths(lanes: dict[int, Element], begin: float) -> dict[int, Float64]:
    """Widths of a section's lanes, from the centre outwards: a border is told from the centre."""
    widths = {}
    edges = {1: NOTHING, -1: NOTHING}  # outwards of the reference line, of the lanes so far
    for lane_id in sorted(lanes, key=abs):
        element, side = lanes[lane_id], 1 if lane_id > 0 else -1
        if lane_id and _has_border(element):
            border = cubics(element.iterfind("border"), "sOffset", begin)
            border[:, 1:] *= side
            widths[lane_id] = summed(border, edges[side], -1.0)
            if widths[lane_id][:, 1].min() < -_BORDERS_CROSS_M:
                raise refused(
                    element,
                    f"the <border> of lane {lane_id} lies on the inner side of the lane within it; "
                    "borders are counted from the reference line, to the right negative",
                )
            edges[side] = border
        else:
            widths[lane_id] = cubics(element.iterfind("width"), "sOffset", begin)
            if lane_id:
                edges[side] = summed(edges[side], widths[lane_id])
    return widths


def _lane(element: Element, lane_id: int, widths: Float64, base: float) -> LaneRecord:
    speeds = (
        (base + station(e, "sOffset", 0.0), speed_limit(e)) for e in element.iterfind("speed")
    )
    return LaneRecord(
        lane_id=lane_id,
        kind=_LANE_KINDS.get(element.get("type", ""), LaneKind.OTHER),
        widths=widths,
        predecessors=tuple(lane_number(e, "id") for e in element.iterfind("link/predecessor")),
        successors=tuple(lane_number(e, "id") for e in element.iterfind("link/successor")),
        marks=tuple(_mark(e, base) for e in element.iterfind("roadMark")),
        speeds=tuple(sorted((s, v) for s, v in speeds if v is not None)),
    )


def _mark(element: Element, base: float) -> tuple[float, bool, bool]:
    """Where a mark begins and which ways it may be crossed; broken lines where it does not say."""
    allowed = element.get("laneChange")
    if allowed is None:
        allowed = "both" if element.get("type", "none") in ("broken", "broken broken") else "none"
    up, down = allowed in ("both", "increase"), allowed in ("both", "decrease")
    return base + number(element, "sOffset", 0.0), up, down
