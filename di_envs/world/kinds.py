"""Names for what is in a world and what happens in it; apart, so that they load without Numba."""

from __future__ import annotations

from enum import IntEnum

TICK_S = 0.05  # of the world: 20 Hz, as in the CARLA Leaderboard


class ActorKind(IntEnum):
    """What an actor is; ABSENT slots hold nobody."""

    ABSENT = 0
    CAR = 1
    VAN = 2
    TRUCK = 3
    BUS = 4
    MOTORCYCLE = 5
    BICYCLE = 6
    WALKER = 7
    PROP = 8


class EventKind(IntEnum):
    """What Leaderboard 1.0 counts, and what ends a route."""

    COLLISION_WALKER = 1
    COLLISION_VEHICLE = 2
    COLLISION_STATIC = 3
    RED_LIGHT = 4
    STOP_SIGN = 5
    OUTSIDE_LANES = 6  # value: metres outside or against the lane
    ROUTE_DEVIATION = 7
    BLOCKED = 8
    TIMEOUT = 9
    COMPLETED = 10
