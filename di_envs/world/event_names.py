"""What events are called: one key in options and files, one name wherever people read of them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from di_envs.world.kinds import EventKind

EVENT_KEYS: Mapping[EventKind, str] = MappingProxyType(
    {kind: kind.name.lower() for kind in EventKind}
)
EVENT_NAMES: Mapping[EventKind, str] = MappingProxyType(
    {
        EventKind.COLLISION_WALKER: "walker hit",
        EventKind.COLLISION_VEHICLE: "vehicle hit",
        EventKind.COLLISION_STATIC: "object hit",
        EventKind.RED_LIGHT: "red light",
        EventKind.STOP_SIGN: "stop sign",
        EventKind.OUTSIDE_LANES: "outside lanes",
        EventKind.ROUTE_DEVIATION: "off route",
        EventKind.BLOCKED: "blocked",
        EventKind.TIMEOUT: "timeout",
        EventKind.COMPLETED: "completed",
        EventKind.SCENARIO: "scenario",
        EventKind.MIN_SPEED: "too slow",
        EventKind.FIRST_HIT_WALKER: "walker hit (each once)",
        EventKind.FIRST_HIT_VEHICLE: "vehicle hit (each once)",
        EventKind.FIRST_HIT_STATIC: "object hit (each once)",
        EventKind.RED_LIGHT_WIDE: "red light (whole line)",
    }
)


def event_of_key(key: str) -> EventKind:
    """The kind whose key that is. KeyError if there is none."""
    return EventKind[key.upper()]
