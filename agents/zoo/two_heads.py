"""Waypoints and an action from one network: how both together are driven by.

Source: Wu et al., Trajectory-guided Control Prediction (TCP), NeurIPS 2022, as Jia et al. drive by
it in ThinkTwice (CVPR 2023) and DriveAdapter (ICCV 2023).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, ClassVar

from torch import Tensor

from agents.base import Control, Observation, make_control
from agents.zoo.controls import PidT
from agents.zoo.driving import SystemAgent, SystemMemory
from agents.zoo.system import Output
from di_envs.actions.controllers import ControllerMemory

_CREEP = 0.05  # of the pedal, above the speed that it is to have
_STANDING_MPS = 0.5
_BRAKES, _BRAKES_FULLY = 0.2, 0.95  # of the pedal
_PEDALS = PidT()


@dataclass(frozen=True, kw_only=True)
class TwoHeads:
    """Rules of thumb over two heads: the action steers, either brakes.

    Attributes:
        throttle: Of the pedal, where neither head brakes, straight on and in turns.
        fast_mps: Above which the pedal is all but let go, straight on and in turns.
        turning: From so much of the wheel on it is a turn.
        stuck: Decisions that it stands before one head that does not brake is enough to go.
    """

    throttle: tuple[float, float]
    fast_mps: tuple[float, float]
    turning: float = 0.07
    stuck: int

    def control(
        self, action: Tensor, followed: Control, speed_mps: float, standing: int
    ) -> Control:
        """The pedals and the wheel.

        Args:
            action: (2,) throttle less brake, and steer.
            followed: What leads along the waypoints.
            speed_mps: Present forward speed.
            standing: Decisions that it has stood.
        """
        pedal, steer = action.tolist()
        throttles = max(pedal, 0.0), float(followed[0])
        brakes = max(-pedal, 0.0), float(followed[2])
        stops = max(brakes) > _BRAKES
        if standing > self.stuck:
            stops = max(throttles) == 0.0 and min(brakes) >= _BRAKES_FULLY
        turn = int(abs(steer) > self.turning)
        throttle = _CREEP if speed_mps > self.fast_mps[turn] else self.throttle[turn]
        return make_control(0.0 if stops else throttle, steer, float(stops))


class TwoHeadsAgent(SystemAgent):
    """Drives by both heads; `rules=off` drives by the waypoints alone."""

    heads: ClassVar[TwoHeads]

    def control(
        self, output: Output, observation: Observation, memory: SystemMemory
    ) -> tuple[Control, ControllerMemory, Any]:
        """By both heads, and how long it has stood."""
        if not self.rules:
            return super().control(dataclasses.replace(output, action=None), observation, memory)
        assert output.action is not None, "this system says an action"
        speed_mps, standing = float(observation["speed"][0]), int(memory.rules or 0)
        followed, errors = _PEDALS.control(
            output.waypoints[0].numpy(), speed_mps, memory.controllers
        )
        control = self.heads.control(output.action[0], followed, speed_mps, standing)
        return control, errors, standing + 1 if speed_mps < _STANDING_MPS else 0
