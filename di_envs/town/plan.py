"""A planned route: what the router makes of a route's keypoints, and all that others read of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class RoadOption(IntEnum):
    """CARLA's high-level commands, with CARLA's numbers."""

    VOID = -1
    LEFT = 1
    RIGHT = 2
    STRAIGHT = 3
    LANEFOLLOW = 4
    CHANGELANELEFT = 5
    CHANGELANERIGHT = 6


@dataclass(frozen=True, kw_only=True)
class ScenarioTrigger:
    """Where on a route one of the Leaderboard's scenarios begins.

    Attributes:
        type: The Leaderboard 1.0's number of the scenario: 1, 3, 4, 7, 8, 9 or 10.
        subtype: CARLA's name of the variant, such as `S4left`; empty where there is one only.
        point: Index of the dense route point nearest to its trigger.
    """

    type: int
    subtype: str
    point: int


# Of `carla.WeatherParameters`, and what 2.x adds to it: the percent of the route
WEATHER_PARAMETERS = (
    "cloudiness",
    "precipitation",
    "precipitation_deposits",
    "wind_intensity",
    "sun_azimuth_angle",
    "sun_altitude_angle",
    "fog_density",
    "fog_distance",
    "fog_falloff",
    "wetness",
    "scattering_intensity",
    "mie_scattering_scale",
    "rayleigh_scattering_scale",
    "dust_storm",
)
PERCENTAGE = "route_percentage"


class Remark(NamedTuple):
    """What is odd about a planned route."""

    text: str  # a sentence that names the keypoint
    off_m: float  # by how many metres: what remarks are ranked by


@dataclass(frozen=True, kw_only=True)
class RouteWeather:
    """A `<weather>` of a route: CARLA's weather parameters, under CARLA's names and units.

    Attributes:
        name: The `id` that some files give it, empty if none.
        parameters: Such as `cloudiness` or `sun_altitude_angle`; in 2.x also `route_percentage`,
            the share of the route at which it is reached.
    """

    name: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class RoutePlan:
    """A dense route of R points at about 1 m, and its T sparse target points. Read-only.

    The points follow lane centres, so they jump sideways at a lane change, and they may step back
    a little where keypoints join, as CARLA's own do.
    """

    route_id: str
    town: str
    keypoints: NDArray[np.float64]  # (K, 3) x, y, z as given in the route file
    points: NDArray[np.float64]  # (R, 4) x, y, z, yaw; yaw of the lane there
    option: NDArray[np.int8]  # (R,) RoadOption
    lane: NDArray[np.int32]  # (R,) lane index into Lanes
    lane_m: NDArray[np.float64]  # (R,) station along that lane
    route_m: NDArray[np.float64]  # (R,) distance along the route (sum of straight steps), from 0
    targets: NDArray[np.int32]  # (T,) indices of the target points (50 m rule), ascending
    scenarios: tuple[ScenarioTrigger, ...] = ()  # by ascending point, one a point
    geo_origin: tuple[float, float] = (
        0.0,
        0.0,
    )  # of the town: latitude, longitude [deg] of x = y = 0
    remarks: tuple[Remark, ...] = ()  # what is odd about it
    weathers: tuple[RouteWeather, ...] = ()  # that its file asks for

    @property
    def length_m(self) -> float:
        """Length of the dense route."""
        return float(self.route_m[-1])

    @property
    def timeout_s(self) -> float:
        """Game time after which Leaderboard 1.0 ends the route: int(0.8 s/m x length + 5 s)."""
        return float(int(0.8 * self.length_m + 5.0))
