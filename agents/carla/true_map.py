"""A town as CARLA's map: waypoints on lanes, what follows them and what lies beside them.

For privileged agents and for our own planners under `agents.navigation`. It is our own in any case,
whether CARLA's wheel is installed or not: then a route over it is the same.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.carla.missing import say_missing
from agents.carla.values import carla_values
from di_envs.sensors.inertial import geodetic
from di_envs.town.lanes import LaneKind
from di_envs.town.queries import LEVEL_M
from di_envs.town.town import Town

REACH_M = 50.0  # from a place to a lane
_LEFT, _RIGHT = 1, 2  # bits of `Lanes.change`
_TYPES = {
    LaneKind.DRIVING: "Driving",
    LaneKind.PARKING: "Parking",
    LaneKind.SHOULDER: "Shoulder",
    LaneKind.SIDEWALK: "Sidewalk",
    LaneKind.BIKING: "Biking",
}


class TrueMap:
    """What `carla.Map` tells of a town, as far as it is known here."""

    def __init__(self, town: Town) -> None:
        self._town = town
        self.name = town.name

    def __getattr__(self, name: str) -> Any:
        return say_missing(self, name)

    @property
    def town(self) -> Town:
        """The town itself."""
        return self._town

    def to_opendrive(self) -> str:
        """The map's text."""
        return self._town.opendrive

    def transform_to_geolocation(self, location: Any) -> Any:
        """Latitude, longitude [deg] and altitude [m] of a place, by the map's own origin."""
        latitude, longitude = geodetic(location.x, location.y, *self._town.geo_origin)
        return carla_values().GeoLocation(latitude, longitude, location.z)

    def get_waypoint(
        self, location: Any, project_to_road: bool = True, lane_type: Any = None
    ) -> Waypoint | None:
        """The nearest place in the middle of a lane.

        Args:
            location: A place.
            project_to_road: Also where that place lies on no lane.
            lane_type: `carla.LaneType`s; None for driving lanes.

        Returns:
            None if there is none within 50 m, or on which the place lies where that is asked for.
        """
        lanes, points = self._town.lanes, self._town.lanes.points
        wanted = np.isin(lanes.kind, _kinds_of(lane_type))[lanes.point_lane]
        wanted &= np.abs(points[:, 2] - location.z) < LEVEL_M
        square = (points[:, 0] - location.x) ** 2 + (points[:, 1] - location.y) ** 2
        point = int(np.where(wanted, square, np.inf).argmin())
        if not wanted[point] or square[point] > REACH_M**2:
            return None
        lane = int(lanes.point_lane[point])
        x, y, _, yaw = points[point].tolist()
        ahead_m = math.cos(yaw) * (location.x - x) + math.sin(yaw) * (location.y - y)
        aside_m = math.cos(yaw) * (location.y - y) - math.sin(yaw) * (location.x - x)
        if not project_to_road and abs(aside_m) > 0.5 * float(lanes.width_m[point]):
            return None
        station_m = (point - int(lanes.first[lane])) * float(lanes.spacing_m[lane]) + ahead_m
        return Waypoint(self, lane, min(max(station_m, 0.0), float(lanes.length_m[lane])))


def _kinds_of(lane_type: Any) -> NDArray[np.int8]:
    if lane_type is None:
        return np.array([LaneKind.DRIVING], np.int8)
    types = carla_values().LaneType
    kinds = [kind for kind, name in _TYPES.items() if int(getattr(types, name)) & int(lane_type)]
    return np.array(kinds, np.int8)


class Waypoint:
    """A place in the middle of a lane, which looks along it.

    Args:
        town_map: Whose lane it is.
        lane: Index of the lane.
        station_m: How far along it in its direction of travel.
    """

    def __init__(self, town_map: TrueMap, lane: int, station_m: float) -> None:
        self._map, self._lane, self._station_m = town_map, lane, station_m

    def __getattr__(self, name: str) -> Any:
        return say_missing(self, name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Waypoint) and self.id == other.id

    def __hash__(self) -> int:
        return self.id

    def __repr__(self) -> str:
        return f"Waypoint(road {self.road_id}, lane {self.lane_id}, s {self.s:.2f})"

    def _between(self) -> tuple[int, float]:
        """The point before it and the share of the way to the next one."""
        lanes = self._map.town.lanes
        position = self._station_m / float(lanes.spacing_m[self._lane])
        k = min(int(position), int(lanes.count[self._lane]) - 2)
        return int(lanes.first[self._lane]) + k, min(position - k, 1.0)

    def _of_point(self, column: NDArray[np.float64]) -> float:
        i, share = self._between()
        return float(column[i] + share * (column[i + 1] - column[i]))

    @property
    def transform(self) -> Any:
        """Its place, and the direction of travel there."""
        carla, points = carla_values(), self._map.town.lanes.points
        x, y, z, yaw = (self._of_point(points[:, k]) for k in range(4))
        turn = math.degrees(math.remainder(yaw, 2.0 * math.pi))
        return carla.Transform(carla.Location(x=x, y=y, z=z), carla.Rotation(yaw=turn))

    @property
    def id(self) -> int:
        """A number of its own: of the lane and the millimetre."""
        return self._lane * 10**8 + round(self._station_m * 1000.0)

    @property
    def road_id(self) -> int:
        """OpenDRIVE's, or its index where that is no number."""
        road = int(self._map.town.lanes.road[self._lane])
        name = self._map.town.road_names[road]
        return int(name) if name.lstrip("-").isdigit() else road

    @property
    def section_id(self) -> int:
        """OpenDRIVE's lane section: the first of those through which the lane goes on."""
        return int(self._map.town.lanes.section[self._lane])

    @property
    def lane_id(self) -> int:
        """OpenDRIVE's."""
        return int(self._map.town.lanes.lane_id[self._lane])

    @property
    def s(self) -> float:
        """Metres along the road's reference line."""
        return self._of_point(self._map.town.lanes.road_m)

    @property
    def is_junction(self) -> bool:
        """Whether it is in a junction."""
        return int(self._map.town.lanes.junction[self._lane]) >= 0

    is_intersection = is_junction

    @property
    def junction_id(self) -> int:
        """Of its junction, -1 for none."""
        junction = int(self._map.town.lanes.junction[self._lane])
        return -1 if junction < 0 else junction

    @property
    def lane_width(self) -> float:
        """Metres."""
        return self._of_point(self._map.town.lanes.width_m)

    @property
    def lane_type(self) -> Any:
        """`carla.LaneType`."""
        kind = LaneKind(int(self._map.town.lanes.kind[self._lane]))
        return getattr(carla_values().LaneType, _TYPES.get(kind, "NONE"))

    @property
    def lane_change(self) -> Any:
        """`carla.LaneChange`: to which sides the line may be crossed."""
        change, carla = int(self._map.town.lanes.change[self._between()[0]]), carla_values()
        names = {0: "NONE", _LEFT: "Left", _RIGHT: "Right", _LEFT | _RIGHT: "Both"}
        return getattr(carla.LaneChange, names[change])

    def may_change(self, left: bool) -> bool:
        """Whether the line to that side may be crossed here."""
        change = int(self._map.town.lanes.change[self._between()[0]])
        return bool(change & (_LEFT if left else _RIGHT))

    def next(self, distance: float) -> list[Waypoint]:
        """The places so many metres further on, one for each way that lanes go on."""
        return self._moved(distance, ahead=True)

    def previous(self, distance: float) -> list[Waypoint]:
        """The places so many metres back."""
        return self._moved(distance, ahead=False)

    def _moved(self, distance: float, *, ahead: bool) -> list[Waypoint]:
        lanes = self._map.town.lanes
        length_m = float(lanes.length_m[self._lane])
        left_m = length_m - self._station_m if ahead else self._station_m
        if distance <= left_m:
            station_m = self._station_m + (distance if ahead else -distance)
            return [Waypoint(self._map, self._lane, station_m)]
        start = lanes.successor_start if ahead else lanes.predecessor_start
        links = lanes.successor if ahead else lanes.predecessor
        found: list[Waypoint] = []
        for link in links[start[self._lane] : start[self._lane + 1]].tolist():
            begin_m = 0.0 if ahead else float(lanes.length_m[link])
            beyond = Waypoint(self._map, link, begin_m)
            found += beyond._moved(distance - left_m, ahead=ahead)
        return found

    def get_left_lane(self) -> Waypoint | None:
        """Beside it on the left, of the same direction; None where there is none."""
        return self._beside(self._map.town.lanes.left)

    def get_right_lane(self) -> Waypoint | None:
        """Beside it on the right, of the same direction; None where there is none."""
        return self._beside(self._map.town.lanes.right)

    def _beside(self, neighbours: NDArray[np.int32]) -> Waypoint | None:
        lanes, lane = self._map.town.lanes, int(neighbours[self._lane])
        if lane < 0:
            return None
        share = self._station_m / float(lanes.length_m[self._lane])
        return Waypoint(self._map, lane, share * float(lanes.length_m[lane]))
