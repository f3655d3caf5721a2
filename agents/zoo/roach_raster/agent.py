"""The driver of `roach-raster`: by its waypoints, or by its action."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from agents import AgentSpecError
from agents.base import Observation
from agents.driveinsight.tap_edits import EditedDecision
from agents.zoo.driving import SystemAgent, SystemMemory
from agents.zoo.system import Output
from di_envs.files.names import check_name


class RoachAgent(SystemAgent):
    """Drives with it.

    Args:
        by: What it is driven by: `waypoints`, or `action`, as it was published.
        weights: As of any system.
        shipped: Likewise.
        rules: Likewise; it has none.
    """

    def __init__(
        self,
        *,
        shipped: str,
        weights: str | Path | None = None,
        rules: str = "on",
        by: str = "waypoints",
    ) -> None:
        try:
            check_name(by, ("waypoints", "action"), "thing to drive by")
        except ValueError as error:
            raise AgentSpecError(f"agent '{shipped}': {error}") from error
        super().__init__(shipped=shipped, weights=weights, rules=rules)
        self._by = by

    def decide(
        self, observation: Observation, memory: SystemMemory, edited: EditedDecision | None = None
    ) -> Output:
        """What the network says, of which only what it is driven by is left."""
        output = super().decide(observation, memory, edited)
        return output if self._by == "action" else dataclasses.replace(output, action=None)
