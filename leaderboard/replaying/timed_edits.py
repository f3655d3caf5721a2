"""World edits at a moment of an episode: `remove:actor=17@t=42.0`, as records keep them.

Agents decide every `control_dt_s`; an edit happens between two decisions, so what the next one is
made of shows it already.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from di_envs.edits.world import WorldEdit, apply_world_edits
from di_envs.route_env import RouteEnv


@dataclass(frozen=True, kw_only=True)
class TimedEdit:
    """A world edit, and the game time at which it is made."""

    edit: WorldEdit
    time_s: float

    def __str__(self) -> str:
        return str(replace(self.edit.to_text(), when=f"t={self.time_s!r}"))


def decisions_before(time_s: float, control_dt_s: float) -> int:
    """How many decisions have been carried out at a game time."""
    return math.floor(time_s / control_dt_s + 1e-6)


class EditPlan:
    """Which edits are due after which decision."""

    def __init__(self, edits: Iterable[TimedEdit], control_dt_s: float) -> None:
        due: dict[int, list[WorldEdit]] = {}
        for timed in edits:
            due.setdefault(decisions_before(timed.time_s, control_dt_s), []).append(timed.edit)
        self._due: Mapping[int, list[WorldEdit]] = due

    def apply(self, env: RouteEnv, decision: int) -> bool:
        """Makes the edits that are due after that many decisions; says whether there were any.

        Raises:
            EditError: If one cannot be made.
        """
        edits = self._due.get(decision, [])
        apply_world_edits(env, edits)
        return bool(edits)
