"""Which of CARLA's sensors an agent of ours needs in CARLA, and its track there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from agents import AgentSpecError
from agents.base import Agent, Requirements
from di_envs.config import check_name
from di_envs.prompt import COMPONENTS
from di_envs.sensors.camera.config import Rig, rig_of
from di_envs.sensors.lidar.config import LIDARS, LidarConfig, lidar_of

REAR_M = 1.4  # behind the car's middle: its rear axle, which goes where the car points
TRUTHS = ("map", "obstacles", "traffic_lights", "stop_signs")  # that only the simulator can tell
GROUPS = ("prompt", "camera", "lidar", "inertial", "odometry")
TICK_S = 0.05
FULL = LIDARS["leaderboard"]  # the only LiDAR that there is


def told_by(agent: Agent[Any]) -> tuple[str, ...]:
    """The prompt's components that an agent reads: all, unless it says which under `told`."""
    if "prompt" not in agent.requires.observations:
        return ()
    told: Sequence[str] = getattr(agent, "told", COMPONENTS)
    for name in told:
        check_name(name, COMPONENTS, "prompt component")
    return tuple(told)


def sensors_of(spec: str, requires: Requirements) -> list[dict[str, Any]]:
    """CARLA's sensors, as an agent's `sensors()` returns them.

    Raises:
        AgentSpecError: If the agent needs what CARLA's Leaderboard has not.
    """
    if requires.privileged or requires.hd_map:
        raise AgentSpecError(
            f"agent '{spec}' reads the world's state or our map, which are not there in CARLA; "
            f"what can be exported reads {', '.join(GROUPS)}."
        )
    for group in requires.observations:
        if group not in GROUPS:
            raise AgentSpecError(
                f"agent '{spec}' needs the group '{group}'; what can be exported reads "
                f"{', '.join(GROUPS)}."
            )
    place = {"x": 0.0, "y": 0.0, "z": 0.0}
    level = {"roll": 0.0, "pitch": 0.0, "yaw": 0.0}
    found: list[dict[str, Any]] = [
        {"type": "sensor.other.gnss", "id": "gnss", **place, "x": -REAR_M},
        {"type": "sensor.other.imu", "id": "imu", **place, **level},
        {"type": "sensor.speedometer", "id": "speed", "reading_frequency": 20},
    ]
    if "camera" in requires.observations:
        found += _cameras(spec, rig_of(requires.options.get("cameras", "small")))
    if "lidar" in requires.observations:
        found.append(_lidar(spec, lidar_of(requires.options.get("lidar", "paper"))))
    return found


def ticks_a_decision(spec: str, requires: Requirements) -> int:
    """CARLA's ticks for which a control is held.

    Raises:
        AgentSpecError: If the agent decides between two ticks.
    """
    ticks = round(requires.control_dt_s / TICK_S)
    if ticks < 1 or abs(ticks * TICK_S - requires.control_dt_s) > 1e-9:
        raise AgentSpecError(
            f"agent '{spec}' decides every {requires.control_dt_s:g} s; CARLA's Leaderboard ticks "
            f"every {TICK_S:g} s, so it must be a multiple of that."
        )
    return ticks


def _cameras(spec: str, rig: Rig) -> list[dict[str, Any]]:
    if rig.depth or rig.semantic or rig.instance:
        raise AgentSpecError(
            f"agent '{spec}' needs depth, tags or instances of its cameras; the Leaderboard has "
            f"sensor.camera.rgb alone."
        )
    return [
        {
            "type": "sensor.camera.rgb",
            "id": camera.name,
            "x": camera.x_m,
            "y": camera.y_m,
            "z": camera.z_m,
            "roll": 0.0,
            "pitch": math.degrees(camera.pitch_rad),
            "yaw": math.degrees(camera.yaw_rad),
            "width": camera.width,
            "height": camera.height,
            "fov": camera.fov_deg,
        }
        for camera in rig.cameras
    ]


def _lidar(spec: str, lidar: LidarConfig) -> dict[str, Any]:
    if lidar.semantic or lidar.instance:
        raise AgentSpecError(f"agent '{spec}' needs tags of its LiDAR, which CARLA's has not.")
    if lidar.channels > FULL.channels or lidar.steps > FULL.steps:
        raise AgentSpecError(
            f"agent '{spec}' needs a LiDAR of {lidar.channels} channels and {lidar.steps} steps; "
            f"the Leaderboard's has {FULL.channels} and {FULL.steps}."
        )
    place = {"x": lidar.x_m, "y": lidar.y_m, "z": lidar.z_m}
    level = {"roll": 0.0, "pitch": 0.0, "yaw": 0.0}
    return {"type": "sensor.lidar.ray_cast", "id": "lidar", **place, **level}
