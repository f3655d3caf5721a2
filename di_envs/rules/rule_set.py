"""What a rule set is: what each event costs, which ends a route, and what the ending is called.

Source: CARLA Leaderboard, branches `leaderboard-1.0`, `-2.0` and `-2.1` (statuses, order).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

from di_envs.files.text_enum import TextEnum
from di_envs.rules.penalties import Penalties
from di_envs.world.event_names import EVENT_KEYS
from di_envs.world.kinds import EventKind

PERFECT = "Perfect"  # what 2.x calls a route completed without an infraction

ENDINGS: Mapping[EventKind, str] = MappingProxyType(
    {
        EventKind.COMPLETED: "Completed",
        EventKind.ROUTE_DEVIATION: "Failed - Agent deviated from the route",
        EventKind.BLOCKED: "Failed - Agent got blocked",
        EventKind.TIMEOUT: "Failed - Agent timed out",
    }
)


# what is put in an ego's way, and what `di-1.0` sees besides: nothing that CARLA's rules count
NOT_CARLAS = frozenset(
    {
        EventKind.SCENARIO,
        EventKind.FIRST_HIT_WALKER,
        EventKind.FIRST_HIT_VEHICLE,
        EventKind.FIRST_HIT_STATIC,
        EventKind.RED_LIGHT_WIDE,
    }
)


class Layout(TextEnum):
    """Whose `results.json` a run's is like."""

    V1 = "1.0"
    V2 = "2.x"


@dataclass(frozen=True, kw_only=True)
class Rules:
    """How events become a score.

    Attributes:
        name: What results call these rules.
        penalties: What an event costs each time. Metres outside lanes take their share of the way
            under all rules.
        layout: Of CARLA's result file, with its statuses.
        completion_decimals: To which the route completion [percent] is rounded; None for not.
        ignored: Kinds that cost nothing and end nothing. Others are refused.
        since_world: The first world version that records all these rules count.
        endings: The route's status by the event that ended it; all rule sets call them alike.
    """

    name: str
    penalties: Penalties
    layout: Layout
    completion_decimals: int | None = None
    ignored: frozenset[EventKind] = NOT_CARLAS
    since_world: int = 1
    endings: ClassVar[Mapping[EventKind, str]] = ENDINGS

    def __post_init__(self) -> None:
        for kind in self.ignored & {*self.scored, *self.endings}:
            raise ValueError(f"{kind.name} cannot be ignored and count too")

    @property
    def scored(self) -> tuple[EventKind, ...]:
        """The kinds that lower the infraction score."""
        return tuple(sorted({*self.penalties.scored, EventKind.OUTSIDE_LANES}))

    @property
    def infractions(self) -> tuple[EventKind, ...]:
        """The kinds that CARLA's tables list, in CARLA's order."""
        kinds = {*self.scored, *self.endings} - {EventKind.COMPLETED}
        return tuple(kind for kind in _LISTED if kind in kinds)

    def check(self, kind: EventKind) -> None:
        """Refuses an event of which these rules say nothing.

        Raises:
            ValueError: If it is neither scored, nor an ending, nor ignored.
        """
        if kind not in self.ignored and kind not in self.scored and kind not in self.endings:
            name = EVENT_KEYS[kind] if isinstance(kind, EventKind) else repr(kind)
            raise ValueError(
                f"the rules {self.name} do not say what the event {name} costs: score it by the "
                "program that recorded it"
            )

    def status(self, kinds: Iterable[EventKind]) -> str:
        """CARLA's status of a route with these events, when no code failed.

        Plain `Failed` when none of them ends a route: an infraction of `terminate_on` did.
        """
        happened = tuple(kinds)
        status = next((self.endings[kind] for kind in happened if kind in self.endings), "Failed")
        flawless = not any(kind in self.infractions for kind in happened)
        if self.layout == Layout.V2 and flawless and EventKind.COMPLETED in happened:
            return PERFECT
        return status


# CARLA's own order; no rule set counts both of a pair
_LISTED = (
    EventKind.COLLISION_WALKER,
    EventKind.FIRST_HIT_WALKER,
    EventKind.COLLISION_VEHICLE,
    EventKind.FIRST_HIT_VEHICLE,
    EventKind.COLLISION_STATIC,
    EventKind.FIRST_HIT_STATIC,
    EventKind.RED_LIGHT,
    EventKind.RED_LIGHT_WIDE,
    EventKind.STOP_SIGN,
    EventKind.OUTSIDE_LANES,
    EventKind.ROUTE_DEVIATION,
    EventKind.TIMEOUT,
    EventKind.BLOCKED,
    EventKind.MIN_SPEED,
)
