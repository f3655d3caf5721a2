"""Names for what is in a world and what happens in it; apart, so that they load without Numba."""

from __future__ import annotations

from enum import IntEnum

TICK_S = 0.05  # of the world: 20 Hz, as in the CARLA Leaderboard


class ActorKind(IntEnum):
    """What an actor is; ABSENT slots hold nobody, PROP and what follows it are lifeless."""

    ABSENT = 0
    CAR = 1
    VAN = 2
    TRUCK = 3
    BUS = 4
    MOTORCYCLE = 5
    BICYCLE = 6
    WALKER = 7
    PROP = 8  # the pole of a signal
    DEBRIS = 9  # lies flat on the road and can be driven over
    VENDING_MACHINE = 10  # what somebody steps out from behind of


class EventKind(IntEnum):
    """What the rule sets count, what ends a route, and what was put in an ego's way."""

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
    SCENARIO = 11  # one began; value: its type, other: its number among the plan's scenarios
    MIN_SPEED = 12  # value: the ego's mean speed in percent of the traffic's; counts in 2.x only
    # by di-1.0, beside what CARLA's rules see: each body once, and the stop line as wide as it is
    FIRST_HIT_WALKER = 13
    FIRST_HIT_VEHICLE = 14
    FIRST_HIT_STATIC = 15
    RED_LIGHT_WIDE = 16
