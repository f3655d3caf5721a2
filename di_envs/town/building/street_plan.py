"""A town as a person would sketch it: streets, junctions and cross sections, in a small table.

A table is JSON, in the world frame (x east, y *south*); reading it turns it to OpenDRIVE's frame
(y north), once. `junction_layout` and `opendrive_writer` make an OpenDRIVE town of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from di_envs.files.json_text import read_json
from di_envs.files.json_values import from_json
from di_envs.files.text_enum import TextEnum
from di_envs.town.building.alignment import Curve, rounded_polyline

LANE_WIDTH_M = 3.5


class Control(TextEnum):
    """Who may go at a junction."""

    LIGHTS = "lights"
    STOP_ALL = "stop_all"
    STOP_STEM = "stop_stem"  # the arm that ends there stops, the road across goes on


class Strip(NamedTuple):
    """One lane of a cross section, of any kind."""

    kind: str  # OpenDRIVE lane type
    width_m: float
    line: str  # OpenDRIVE road mark on its outer side


@dataclass(frozen=True, kw_only=True)
class CrossSection:
    """The lanes of one half of a street; both halves are alike."""

    lanes: int  # driving lanes in each direction
    speed_kmh: float
    median_m: float = 0.0  # of both halves together; 0 is a painted double line
    parking_m: float = 0.0
    shoulder_m: float = 0.5
    kerb_m: float = 0.6
    sidewalk_m: float = 2.0

    @property
    def first_lane(self) -> int:
        """The lane id of the innermost driving lane, without its sign."""
        return 2 if self.median_m > 0.0 else 1

    def inner_edge_m(self, lane: int) -> float:
        """Distance from the street's middle to the inner edge of driving lane 1, 2, …"""
        return self.median_m / 2.0 + (lane - 1) * LANE_WIDTH_M

    @property
    def paved_m(self) -> float:
        """Half width of median, driving and parking lanes together."""
        return self.inner_edge_m(self.lanes + 1) + self.parking_m

    def strips(self) -> tuple[Strip, ...]:
        """The lanes of one half, from the middle outwards."""
        rows = [Strip("median", self.median_m / 2.0, "solid yellow")]
        rows += [Strip("driving", LANE_WIDTH_M, "broken")] * (self.lanes - 1)
        rows += [Strip("driving", LANE_WIDTH_M, "solid")]
        rows += [Strip("parking", self.parking_m, "solid"), *self.verge()]
        return tuple(row for row in rows if row.width_m > 0.0)

    def verge(self) -> tuple[Strip, ...]:
        """Shoulder, kerb and sidewalk: what also runs round the corners of junctions."""
        rows = (
            Strip("shoulder", self.shoulder_m, "none"),
            Strip("border", self.kerb_m, "curb"),
            Strip("sidewalk", self.sidewalk_m, "none"),
        )
        return tuple(row for row in rows if row.width_m > 0.0)


@dataclass(frozen=True, kw_only=True)
class Street:
    """A road between two junctions, drawn as a polyline with rounded corners."""

    id: int
    section: CrossSection
    start: int  # junction where it begins
    end: int
    points: tuple[tuple[float, float, float], ...]  # x, y (OpenDRIVE frame), corner radius [m]
    profile: tuple[tuple[float, float], ...] = ((0.0, 0.0),)  # station, height [m]

    def curve(self) -> Curve:
        """Its middle line."""
        return rounded_polyline(self.points)


@dataclass(frozen=True, kw_only=True)
class Junction:
    """A crossing or a T: its arms are the streets that begin or end there."""

    id: int
    control: Control
    left_turns: bool = True
    one_phase: tuple[tuple[int, ...], ...] = ()  # streets whose lights are green together


@dataclass(frozen=True, kw_only=True)
class StreetPlan:
    """The whole sketch."""

    name: str
    about: str = ""  # where the figures come from
    latitude: float  # of x = y = 0 [deg]
    longitude: float
    junctions: tuple[Junction, ...]
    streets: tuple[Street, ...]

    def __post_init__(self) -> None:
        known = {junction.id for junction in self.junctions}
        for street in self.streets:
            for end in (street.start, street.end):
                if end not in known:
                    raise ValueError(
                        f"street {street.id} joins junction {end}, which the table does not list; "
                        f"listed: {sorted(known)}"
                    )
        numbers = [street.id for street in self.streets]
        if len(set(numbers)) < len(numbers) or len(known) < len(self.junctions):
            raise ValueError(f"plan '{self.name}' gives an id to two streets or two junctions")


# A table's objects, as it spells them


@dataclass(frozen=True, kw_only=True)
class _Street:
    id: int
    section: str
    start: int
    end: int
    points: tuple[tuple[float, ...], ...]  # x, y (world frame), corner radius if there is one
    profile: tuple[tuple[float, float], ...] = ((0.0, 0.0),)

    def __post_init__(self) -> None:
        for point in self.points:
            if len(point) not in (2, 3):
                raise ValueError(f"points are [x, y] or [x, y, radius], not {list(point)}")

    def street(self, sections: Mapping[str, CrossSection]) -> Street:
        """The street, with its section."""
        if self.section not in sections:
            raise ValueError(
                f"street {self.id} has section '{self.section}'; known: {sorted(sections)}"
            )
        # from the world frame to OpenDRIVE's: here, and nowhere else
        points = tuple((x, -y, radius[0] if radius else 0.0) for x, y, *radius in self.points)
        return Street(
            id=self.id,
            section=sections[self.section],
            start=self.start,
            end=self.end,
            points=points,
            profile=self.profile,
        )


@dataclass(frozen=True, kw_only=True)
class _Table:
    name: str
    about: str = ""
    latitude: float
    longitude: float
    sections: Mapping[str, CrossSection]
    junctions: tuple[Junction, ...]
    streets: tuple[_Street, ...]


def read_plan(path: Path) -> StreetPlan:
    """Reads a table of streets.

    Raises:
        ValueError: As `plan_of`, or if the file is no JSON.
    """
    return plan_of(read_json(path), str(path))


def plan_of(values: Any, source: str = "street table") -> StreetPlan:
    """The plan that a table of streets describes, as JSON has it.

    Args:
        values: JSON values.
        source: What errors call the file.

    Raises:
        ValueError: If a key is unknown or missing, a value of another type, or if a street names a
            section or junction that is not there.
    """
    table = from_json(_Table, values, source)
    return StreetPlan(
        name=table.name,
        about=table.about,
        latitude=table.latitude,
        longitude=table.longitude,
        junctions=table.junctions,
        streets=tuple(street.street(table.sections) for street in table.streets),
    )
