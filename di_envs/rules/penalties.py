"""What infractions cost, and the infraction score that they make: one arithmetic for all rule sets.

The reward and the leaderboard's score go by it alike. The numbers stand in the rule sets' files.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

from di_envs.files.text_enum import TextEnum
from di_envs.world.event_names import EVENT_KEYS
from di_envs.world.kinds import EventKind


class Form(TextEnum):
    """How infractions combine."""

    PRODUCT = "product"  # the score is multiplied by each one's factor
    SUM = "sum"  # the score is 1 / (1 + the sum of their costs)


@dataclass(frozen=True, kw_only=True)
class Penalties:
    """Costs of one rule set.

    Attributes:
        form: How they combine.
        costs: For PRODUCT each kind's factor, within (0, 1]; for SUM what it adds, above 0.
        min_speed: What standing still from one checkpoint to the next would take: from the factor
            1, or add to the sum; in proportion for an ego slower than the traffic. 0 where the
            minimum speed does not count.
    """

    form: Form
    costs: Mapping[EventKind, float]
    min_speed: float = 0.0

    def __post_init__(self) -> None:
        for kind, cost in self.costs.items():
            if not (0.0 < cost <= 1.0 if self.form == Form.PRODUCT else cost > 0.0):
                wanted = "in (0, 1]" if self.form == Form.PRODUCT else "above 0"
                raise ValueError(f"the cost of {kind.name} must be {wanted}, not {cost}")
        if not 0.0 <= self.min_speed < 1.0:
            raise ValueError(f"min_speed must be in [0, 1), not {self.min_speed}")
        object.__setattr__(self, "costs", MappingProxyType(dict(self.costs)))

    @cached_property
    def scored(self) -> tuple[EventKind, ...]:
        """The kinds that cost something each time, in the order of `EventKind`."""
        kinds = [*self.costs, *([EventKind.MIN_SPEED] if self.min_speed else [])]
        return tuple(sorted(kinds))

    @cached_property
    def no_terms(self) -> Mapping[str, float]:
        """What the scored kinds take of a step without an infraction, by name: nothing."""
        return MappingProxyType({EVENT_KEYS[kind]: 0.0 for kind in self.scored})

    def infraction_score(
        self,
        counts: Sequence[int] | Mapping[EventKind, int],
        pace_shares: Iterable[float] = (),
        outside_shares: Iterable[float] = (),
    ) -> float:
        """The infraction score, 0..1: the same bits whatever the order of the infractions.

        Args:
            counts: How often each kind happened, by `EventKind`.
            pace_shares: At each checkpoint the ego's share of the traffic's mean speed, 0..1.
            outside_shares: The parts of the way, 0..1, outside lanes; at most one, as a rule.
        """
        factors = [1.0 - share for share in outside_shares]
        slow = [1.0 - share for share in pace_shares if share < 1.0] if self.min_speed else []
        costs: list[float] = []
        for kind, cost in self.costs.items():
            if counts[kind]:
                costs += [cost] * counts[kind]
        if not (costs or slow or factors):
            return 1.0
        if self.form == Form.PRODUCT:
            factors += costs + [1.0 - self.min_speed * part for part in slow]
            total = 0.0
        else:
            total = math.fsum(costs + [self.min_speed * part for part in slow])
        # multiplied in order of size: no order of events can change a bit
        return math.prod(sorted(factors)) / (1.0 + total)
