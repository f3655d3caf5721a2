"""`BehaviorAgent` for agents for CARLA: a `BasicAgent` that drives as fast as is allowed.

Source: interface of CARLA's `agents.navigation.behavior_agent` (MIT licence); our own code. It
keeps its distance as `BasicAgent` does and changes lanes only where its route does.
"""

from __future__ import annotations

from typing import Any

from agents.navigation.basic_agent import BasicAgent
from di_envs.config import check_name

# kilometres an hour: at most, and below what is allowed
BEHAVIORS = {"cautious": (40.0, 6.0), "normal": (50.0, 3.0), "aggressive": (70.0, 1.0)}


class BehaviorAgent(BasicAgent):
    """Drives a vehicle along a route, after its mood.

    Args:
        vehicle: The actor.
        behavior: `cautious`, `normal` or `aggressive`.
        opt_dict: As of a `BasicAgent`.
        map_inst: As of a `BasicAgent`.
        grp_inst: As of a `BasicAgent`.
    """

    def __init__(
        self,
        vehicle: Any,
        behavior: str = "normal",
        opt_dict: dict[str, Any] | None = None,
        map_inst: Any = None,
        grp_inst: Any = None,
    ) -> None:
        check_name(behavior, BEHAVIORS, "behavior")
        self._most_kph, self._below_kph = BEHAVIORS[behavior]
        super().__init__(vehicle, self._most_kph, opt_dict, map_inst, grp_inst)

    def run_step(self, debug: bool = False) -> Any:
        """The control of this tick."""
        limit_kph = float(self._vehicle.get_speed_limit())
        speed_kph = limit_kph - self._below_kph if limit_kph > 0.0 else self._most_kph
        self.set_target_speed(min(self._most_kph, speed_kph))
        return super().run_step(debug)
