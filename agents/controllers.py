"""Waypoints into controls, for agents: `di_envs.controllers`, which wrappers share."""

from __future__ import annotations

from di_envs.controllers import (
    ControllerMemory,
    Errors,
    PIDGains,
    WaypointControllerConfig,
    pid_step,
    waypoints_to_control,
)

__all__ = [
    "ControllerMemory",
    "Errors",
    "PIDGains",
    "WaypointControllerConfig",
    "pid_step",
    "waypoints_to_control",
]
