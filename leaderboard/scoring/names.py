"""What people call events and scenarios: one name each, in every table, map and picture."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from di_envs.world.event_names import EVENT_NAMES

__all__ = ["EVENT_NAMES", "SCENARIO_NAMES"]

# By the Leaderboard's number
SCENARIO_NAMES: Mapping[str, str] = MappingProxyType(
    {
        "1": "debris, and control is lost for a moment",
        "3": "somebody steps out from behind an obstacle",
        "4": "somebody crosses after a turn",
        "7": "crossing traffic gets green too",
        "8": "unprotected left turn",
        "9": "right turn into crossing traffic",
        "10": "crossing without lights",
    }
)
