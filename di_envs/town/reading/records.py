"""What an OpenDRIVE file says, as records in its own frame (right-handed) and stations."""

from __future__ import annotations

from dataclasses import dataclass

from di_envs.numerics.arrays import Float64
from di_envs.town.lanes import LaneKind

GEOMETRY_SHAPES = ("line", "arc", "spiral", "poly3", "paramPoly3")


@dataclass(frozen=True, kw_only=True, slots=True)
class LaneRecord:
    """One lane of one section."""

    lane_id: int
    kind: LaneKind
    widths: Float64  # (n, 5) station, a, b, c, d
    predecessors: tuple[int, ...]
    successors: tuple[int, ...]
    # (station, crossed towards greater ids, crossed towards smaller ids) of the outer road mark
    marks: tuple[tuple[float, bool, bool], ...]
    speeds: tuple[tuple[float, float], ...]  # (station, m/s)


@dataclass(frozen=True, kw_only=True, slots=True)
class SectionRecord:
    """A stretch of road with the same lanes, centre lane included."""

    begin: float
    end: float
    lanes: dict[int, LaneRecord]


@dataclass(frozen=True, kw_only=True, slots=True)
class RoadLink:
    """What one end of a road joins; `at_start` says which end of a road it is."""

    is_junction: bool
    element_id: str
    at_start: bool


@dataclass(frozen=True, kw_only=True, slots=True)
class GeometryRecord:
    """One piece of a reference line: `shape` is one of GEOMETRY_SHAPES."""

    shape: str
    begin: float
    length: float
    x: float
    y: float
    heading: float
    parameters: tuple[float, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class SignalRecord:
    """A signal, or a reference to one from another road (`is_reference`)."""

    signal_id: str
    is_reference: bool
    type: str
    name: str
    s: float
    t: float
    z_offset: float
    orientation: str  # "+", "-" or "none"
    validity: tuple[tuple[int, int], ...]  # (from lane, to lane)


@dataclass(frozen=True, kw_only=True, slots=True)
class CrosswalkRecord:
    """A crosswalk's outline; corners are local (u, v) or along the road (s, t)."""

    s: float
    t: float
    heading: float
    z_offset: float
    corners: Float64  # (n, 3) u, v, z or s, t, dz
    on_road: bool  # corners are (s, t)


@dataclass(frozen=True, kw_only=True, slots=True)
class RoadRecord:
    """A road; `junction` is None outside junctions."""

    road_id: str
    line: int  # of the file, where it begins
    length: float
    junction: str | None
    right_hand: bool
    predecessor: RoadLink | None
    successor: RoadLink | None
    speeds: tuple[tuple[float, float], ...]  # (station, m/s)
    geometry: tuple[GeometryRecord, ...]
    elevation: Float64  # (n, 5)
    superelevation: Float64  # (n, 5) rad; positive: it falls to the right
    crossfall: tuple[Float64, Float64]  # (n, 5) rad each: its left and right side fall outwards
    lane_offset: Float64  # (n, 5)
    sections: tuple[SectionRecord, ...]
    signals: tuple[SignalRecord, ...]
    crosswalks: tuple[CrosswalkRecord, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Connection:
    """A way through a junction, or straight into another road at a direct junction."""

    junction: str
    incoming_road: str
    connecting_road: str
    is_direct: bool
    at_start: bool  # it enters the connecting road at its start
    lane_links: tuple[tuple[int, int], ...]


@dataclass(frozen=True, kw_only=True)
class OpenDrive:
    """A whole file."""

    roads: tuple[RoadRecord, ...]
    junctions: dict[str, tuple[Connection, ...]]
    light_order: dict[str, tuple[int, int]]  # signal id -> (sequence, place) of its controller
    geo_origin: tuple[float, float]
