"""The driver of `interfuser`: its waypoints steer, its safety controller says how fast."""

from __future__ import annotations

from typing import Any

import numpy as np

from agents.base import Control, Observation, make_control
from agents.zoo.controls import PidT
from agents.zoo.driving import SystemAgent, SystemMemory
from agents.zoo.interfuser.config import InterfuserConfig
from agents.zoo.interfuser.safety import (
    CREEP,
    STEP_M,
    SafetyMemory,
    creeping,
    free_m,
    obeying,
    objects_of,
    safe_speed_mps,
    way_of,
)
from agents.zoo.system import Output
from di_envs.actions.controllers import ControllerMemory

LEAST_AIM_M = 2.0  # that it steers at, where it plans to stand
_PEDALS = PidT()


class InterfuserAgent(SystemAgent):
    """Drives with it; `rules=off` leaves its waypoints alone."""

    def control(
        self, output: Output, observation: Observation, memory: SystemMemory
    ) -> tuple[Control, ControllerMemory, Any]:
        """The wheel by the waypoints, the pedals by how far the way is free."""
        if not self.rules:
            return super().control(output, observation, memory)
        config, said = self.network.config, output.said
        assert isinstance(config, InterfuserConfig)
        assert said is not None
        waypoints, speed_mps = output.waypoints[0].numpy(), float(observation["speed"][0])
        objects = objects_of(said["objects"][0].numpy(), config.cells)
        way = way_of(waypoints, np.asarray(observation["target_point"]))
        free = (free_m(way, objects, 0.0), free_m(way, objects, 0.5), free_m(way, objects, 1.0))
        rules = memory.rules or SafetyMemory()
        stops, rules = obeying(said["traffic"][0].sigmoid().numpy(), speed_mps, rules)
        creeps, rules = creeping(speed_mps, rules)
        wanted_mps = 0.0 if stops else safe_speed_mps(free, speed_mps)
        middle_m = float(np.hypot(*(0.5 * (waypoints[0] + waypoints[1]))))
        aim = way[min(int(max(middle_m, LEAST_AIM_M) / STEP_M), len(way) - 1)]
        control, errors = _PEDALS.towards(
            (float(aim[0]), float(aim[1])), wanted_mps, speed_mps, memory.controllers
        )
        if creeps:
            control = make_control(CREEP, float(control[1]), 0.0)
        return control, errors, rules
