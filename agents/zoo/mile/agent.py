"""The driver of `mile`: by its action, also with its eyes shut for a while."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from torch import Tensor

from agents import AgentSpecError
from agents.base import Control, Observation
from agents.zoo.driving import SystemAgent, SystemMemory
from agents.zoo.system import CONTROL_DT_S, Output
from di_envs.actions.controllers import ControllerMemory


class MileAgent(SystemAgent):
    """Drives with it; `rules=off` drives by where it says that its action leads.

    Args:
        imagine_s: It looks for so long, then drives for so long by what it imagines, in turn; 0 for
            eyes that are always open.
        weights: As of any system.
        shipped: Likewise.
        rules: Likewise.
    """

    def __init__(
        self,
        *,
        shipped: str,
        weights: str | Path | None = None,
        rules: str = "on",
        imagine_s: str = "0",
    ) -> None:
        super().__init__(shipped=shipped, weights=weights, rules=rules)
        try:
            self._decisions = round(float(imagine_s) / CONTROL_DT_S)
        except (ValueError, OverflowError) as error:
            raise AgentSpecError(
                f"agent '{shipped}': imagine_s must be seconds, not '{imagine_s}'"
            ) from error

    def seen(self, observation: Observation, memory: SystemMemory) -> dict[str, Tensor]:
        """Everything, or nothing but how many there are to decide for."""
        seen = super().seen(observation, memory)
        shut = self._decisions > 0 and memory.decision // self._decisions % 2 == 1
        return {"speed": seen["speed"]} if shut else seen

    def control(
        self, output: Output, observation: Observation, memory: SystemMemory
    ) -> tuple[Control, ControllerMemory, Any]:
        """By the action; without rules by the waypoints."""
        if not self.rules:
            output = dataclasses.replace(output, action=None)
        return super().control(output, observation, memory)
