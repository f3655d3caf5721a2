"""Where the car is, by GNSS, compass and speed, as any agent of track SENSORS must find out.

GNSS is 0.6 m off in each reading, so the place is reckoned by speed and compass, from the route's
first point on, and corrected a little by each reading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from typing_extensions import Self

from agents.carla.exported.sensors import REAR_M, TICK_S
from di_envs.sensors.inertial import EARTH_RADIUS_M

FIRST_FIXES, MOST_FIXES = 100.0, 150.0  # readings that the place is worth: at first, and at most
_RATE, _COMPASS = 5, 6  # of an IMU


@dataclass(frozen=True, kw_only=True)
class Globe:
    """From degrees to the world's metres, by Mercator: read off a route that is told in both.

    Attributes:
        first: Longitude and northing [rad] of the route's first point.
        place: x and y of it [m].
        scale_m: Metres a radian.
    """

    first: tuple[float, float]
    place: tuple[float, float]
    scale_m: float

    @classmethod
    def of_route(cls, gps: NDArray[np.float64], world: NDArray[np.float64]) -> Self:
        """By a route.

        Args:
            gps: (R, 2) latitude, longitude [deg].
            world: (R, 2) x, y [m], of the same points.
        """
        mercator = np.array([_mercator(*point) for point in gps.tolist()])
        away, metres = mercator - mercator[0], world - world[0]
        square = float((away**2).sum())
        scale_m = float((away * metres).sum()) / square if square > 0.0 else EARTH_RADIUS_M
        return cls(first=tuple(mercator[0]), place=tuple(world[0]), scale_m=scale_m)

    def metres(self, latitude: float, longitude: float) -> tuple[float, float]:
        """x and y [m] of a place [deg]."""
        east, south = _mercator(latitude, longitude)
        return (
            self.place[0] + self.scale_m * (east - self.first[0]),
            self.place[1] + self.scale_m * (south - self.first[1]),
        )


def _mercator(latitude: float, longitude: float) -> tuple[float, float]:
    """Radians to the east, and to the south by Mercator."""
    north = math.log(math.tan(math.radians(90.0 + latitude) / 2.0))
    return math.radians(longitude), -north


@dataclass(frozen=True, kw_only=True)
class Reckoning:
    """Where the rear axle is reckoned to be.

    Attributes:
        x: Metres in the world frame.
        y: Metres.
        yaw: Of the car, by its compass [rad].
        speed_mps: Of the car.
        fixes: Readings of GNSS that this is worth.
    """

    x: float
    y: float
    yaw: float
    speed_mps: float = 0.0
    fixes: float = FIRST_FIXES

    @classmethod
    def at(cls, x: float, y: float, yaw: float) -> Self:
        """Of a car whose middle is there."""
        return cls(x=x - REAR_M * math.cos(yaw), y=y - REAR_M * math.sin(yaw), yaw=yaw)

    def after(
        self, gnss: tuple[float, float], imu: NDArray[np.float64], speed_mps: float
    ) -> Reckoning:
        """A tick later.

        Args:
            gnss: x, y [m] that GNSS says of the rear axle.
            imu: (7,) as CARLA's; a compass that is NaN, as CARLA's can be, is replaced by the rate
                of turn.
            speed_mps: By the speedometer.
        """
        yaw = float(imu[_COMPASS]) - 0.5 * math.pi
        if not math.isfinite(yaw):
            yaw = self.yaw + TICK_S * float(imu[_RATE])
        middle = self.yaw + 0.5 * math.remainder(yaw - self.yaw, 2.0 * math.pi)
        far_m = 0.5 * (self.speed_mps + speed_mps) * TICK_S
        x, y = self.x + far_m * math.cos(middle), self.y + far_m * math.sin(middle)
        fixes = min(self.fixes + 1.0, MOST_FIXES)
        return replace(
            self,
            x=x + (gnss[0] - x) / fixes,
            y=y + (gnss[1] - y) / fixes,
            yaw=yaw,
            speed_mps=speed_mps,
            fixes=fixes,
        )

    @property
    def pose(self) -> tuple[float, float, float]:
        """x, y [m] of the car's middle, and its yaw [rad]."""
        ahead, right = REAR_M * math.cos(self.yaw), REAR_M * math.sin(self.yaw)
        return self.x + ahead, self.y + right, self.yaw
