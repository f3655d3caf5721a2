"""Rules of a benchmark as named data: what an event costs, and what a route's ending is called.

A change that can move a score is a new name in `RULES`, never an edit of an old one.
Source: CARLA Leaderboard, branch `leaderboard-1.0` (penalties and route statuses).
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from di_envs.reward import PENALTIES
from di_envs.world.state import EventKind


@dataclass(frozen=True, kw_only=True)
class Rules:
    """How events become a score.

    Attributes:
        name: What results call these rules.
        factors: The infraction score is multiplied by this, once an event; within (0, 1].
        proportional: Kinds whose value is a distance [m]: they multiply the infraction score by
            1 - distance / distance travelled along the route.
        endings: The route's status by the event that ended it.
    """

    name: str
    factors: Mapping[EventKind, float]
    proportional: frozenset[EventKind]
    endings: Mapping[EventKind, str]

    def __post_init__(self) -> None:
        for kind, factor in self.factors.items():
            if not 0.0 < factor <= 1.0:
                raise ValueError(f"the factor of {kind.name} must be in (0, 1], not {factor}")
        for kind in self.proportional & self.factors.keys():
            raise ValueError(f"{kind.name} cannot have a factor and be proportional too")


CARLA_1_0 = Rules(
    name="carla-1.0",
    factors=PENALTIES["carla-1.0"],
    proportional=frozenset({EventKind.OUTSIDE_LANES}),
    endings=MappingProxyType(
        {
            EventKind.COMPLETED: "Completed",
            EventKind.ROUTE_DEVIATION: "Failed - Agent deviated from the route",
            EventKind.BLOCKED: "Failed - Agent got blocked",
            EventKind.TIMEOUT: "Failed - Agent timed out",
        }
    ),
)

RULES: Mapping[str, Rules] = MappingProxyType({rules.name: rules for rules in (CARLA_1_0,)})


def rules_named(name: str) -> Rules:
    """The rules of that name.

    Raises:
        ValueError: If there are none; the message lists those there are.
    """
    if name not in RULES:
        near = difflib.get_close_matches(name, RULES, n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise ValueError(f"unknown rules '{name}'; {hint}known: {', '.join(RULES)}")
    return RULES[name]
