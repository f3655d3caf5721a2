"""The controller that was published with most systems, and the one that all share without rules."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from agents.base import Control, make_control
from di_envs.actions.controllers import (
    ControllerMemory,
    PIDGains,
    WaypointControllerConfig,
    pid_step,
)

FOLLOWING = WaypointControllerConfig()  # brakes as hard as waypoints say: no rule of thumb


@dataclass(frozen=True, kw_only=True)
class PidT:
    """The controller that most of the systems share: full brake or none, by rules of thumb.

    The car is to be as fast as between the first two waypoints, and is steered at the point midway.
    Source: Chen et al., Learning by Cheating, CoRL 2019; Prakash et al., TransFuser, CVPR 2021.
    What we changed: waypoints are in our frame (y to the right).

    Attributes:
        brake_mps: Wanted slower than that, it brakes.
        brake_ratio: … and when it is so many times as fast as wanted.
        most_throttle: Of the pedal.
        most_delta_mps: To which the error of the speed is clipped from above.
        turn: From the bearing of the aim, as a share of a quarter turn, to the wheel.
        speed: From the error of the speed to the pedal.
    """

    brake_mps: float = 0.1
    brake_ratio: float = 1.1
    most_throttle: float = 0.75
    most_delta_mps: float = 0.25
    turn: PIDGains = field(
        default_factory=lambda: PIDGains(proportional=1.25, integral=0.75, derivative=0.3)
    )
    speed: PIDGains = field(
        default_factory=lambda: PIDGains(proportional=5.0, integral=0.5, derivative=1.0)
    )

    def control(
        self, waypoints: NDArray[np.floating], speed_mps: float, memory: ControllerMemory
    ) -> tuple[Control, ControllerMemory]:
        """The pedals, the wheel, and past errors.

        Args:
            waypoints: (T, 2) x ahead, y right [m], 0.5 s apart; T at least 2.
            speed_mps: Present forward speed.
            memory: What the last call returned.
        """
        (x0, y0), (x1, y1) = waypoints[:2].tolist()
        wanted_mps = 2.0 * math.hypot(x1 - x0, y1 - y0)
        aim = (0.5 * (x0 + x1), 0.5 * (y0 + y1))
        return self.towards(aim, wanted_mps, speed_mps, memory)

    def towards(
        self,
        aim: tuple[float, float],
        wanted_mps: float,
        speed_mps: float,
        memory: ControllerMemory,
    ) -> tuple[Control, ControllerMemory]:
        """The same for a place to steer at, x ahead, y right [m], and a speed."""
        brakes = wanted_mps < self.brake_mps or speed_mps > self.brake_ratio * wanted_mps
        delta = min(max(wanted_mps - speed_mps, 0.0), self.most_delta_mps)
        throttle, speed_errors = pid_step(self.speed, memory.speed, delta)
        throttle = 0.0 if brakes else min(max(throttle, 0.0), self.most_throttle)
        angle = math.atan2(aim[1], aim[0]) / (0.5 * math.pi) if speed_mps >= 0.01 else 0.0
        steer, turn_errors = pid_step(self.turn, memory.turn, angle)
        control = make_control(throttle, steer, float(brakes))
        return control, ControllerMemory(turn=turn_errors, speed=speed_errors)
