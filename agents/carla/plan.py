"""A route as the CARLA Leaderboard hands it to an agent: as GPS coordinates and as transforms.

Both lists hold every point of the dense route with its `RoadOption`; the agent's own
`set_global_plan` thins them out. Source: behaviour of the Leaderboard's
`leaderboard/utils/route_manipulation.py` (MIT licence); our own code.
"""

from __future__ import annotations

import math
from typing import Any

from agents.carla.values import carla_values
from di_envs.sensors.inertial import EARTH_RADIUS_M, geodetic
from di_envs.town.plan import RoadOption, RoutePlan

GpsPlan = list[tuple[dict[str, float], RoadOption]]
WorldPlan = list[tuple[Any, RoadOption]]


def global_plan(
    plan: RoutePlan, origin: tuple[float, float] | None = None
) -> tuple[GpsPlan, WorldPlan]:
    """The dense route twice, point by point alike.

    Args:
        plan: The route.
        origin: Latitude and longitude [deg] of x = y = 0; None for what the town's map says.

    Returns:
        Dicts of `lat` [deg], `lon` [deg] and `z` [m], each with its option; and `carla.Transform`s
        (or what stands in for them, see `agents.carla.values`), each with its option.
    """
    carla = carla_values()
    gps: GpsPlan = []
    world: WorldPlan = []
    for (x, y, z, yaw), value in zip(plan.points.tolist(), plan.option.tolist(), strict=True):
        option = RoadOption(value)
        latitude, longitude = geodetic(x, y, *(origin or plan.geo_origin))
        gps.append(({"lat": latitude, "lon": longitude, "z": z}, option))
        place = carla.Location(x=x, y=y, z=z)
        rotation = carla.Rotation(pitch=0.0, yaw=math.degrees(yaw), roll=0.0)
        world.append((carla.Transform(place, rotation), option))
    return gps, world


def moved(
    latitude: float, longitude: float, east_m: float, south_m: float, origin_latitude: float
) -> tuple[float, float]:
    """Where a place lies that is so many world metres off, by the same Mercator [deg]."""
    scale_m = EARTH_RADIUS_M * math.cos(math.radians(origin_latitude))
    north_m = scale_m * math.log(math.tan(math.radians(90.0 + latitude) / 2.0)) - south_m
    moved_latitude = 2.0 * math.degrees(math.atan(math.exp(north_m / scale_m))) - 90.0
    return moved_latitude, longitude + math.degrees(east_m / scale_m)
