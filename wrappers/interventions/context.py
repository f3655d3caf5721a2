"""What an edit may ask about the moment: time, progress, the way to the next junction, and keys."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from di_envs.world.kinds import TICK_S


@dataclass(frozen=True, kw_only=True, slots=True)
class EditContext:
    """A moment of an episode, or of many: each a number, or (...) numbers, one for each world.

    Attributes:
        seed: The world's; with `tick` and `ego` what draws are keyed by.
        tick: World ticks since the episode began.
        ego: Index of the ego that looks.
        decision: How many decisions the agent has made since then: 0 for what a reset shows.
        time_s: Game time since then.
        route_completion: Percent.
        junction_m: Along the route to the next junction; 0 in one, infinite after the last.
    """

    seed: Any
    tick: Any
    decision: Any
    time_s: Any
    route_completion: Any
    junction_m: Any
    ego: Any = 0

    def values(self) -> Mapping[str, Any]:
        """What conditions ask about, by their names for it."""
        return {"t": self.time_s, "junction": self.junction_m, "route": self.route_completion}


def context_of(info: Mapping[str, Any], control_dt_s: float, ego: int = 0) -> EditContext:
    """The moment that an environment's `info` describes; of many worlds where its entries are.

    Args:
        info: Of a `reset` or a `step`.
        control_dt_s: For how long an action is held.
        ego: Which one looks.
    """
    time_s = info["game_time_s"]
    ticks = time_s / TICK_S
    # Python's own arithmetic for one world: it takes a tenth of the time
    tick = round(ticks) if isinstance(ticks, float) else np.rint(ticks).astype(np.int64)
    return EditContext(
        seed=info["world_seed"],
        tick=tick,
        decision=tick // round(control_dt_s / TICK_S),
        time_s=time_s,
        route_completion=info["route_completion"],
        junction_m=info["junction_m"],
        ego=ego,
    )
