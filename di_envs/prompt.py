"""The structured prompt: what a driver is told about the world, as fixed-size arrays.

Nine components, each of which tells only its own story: the map, the obstacles, the lights and the
signs are chosen by distance and never by the route, obstacles move over the ground and not relative
to the ego, and past speeds leave the present one out. So to drop or edit one takes away just that.
Everything is in the ego frame (x ahead, y right; yaw relative to the ego's). What is more than 3 m
above or below the ego, as on a bridge, is left out, except the route's own points.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Float32, Float64, Int8, Int32, Int64
from di_envs.numerics.bundles import by_reference
from di_envs.town.lanes import Signals
from di_envs.town.map_chunks import POINTS
from di_envs.town.plan import RoutePlan
from di_envs.world.state import SPEED_HISTORY

COMPONENTS = (
    "command",
    "target_point",
    "routing",
    "map",
    "obstacles",
    "traffic_lights",
    "stop_signs",
    "speed",
    "speed_history",
)  # in the order of `prompt_present`
ROUTING_POINTS = 50
MAP_POLYLINES = 64
OBSTACLES = 32
LIGHTS = 8
STOP_SIGNS = 4
OBSTACLE_RANGE_M = 80.0
SIGNAL_RANGE_M = 50.0
LEVEL_M = 3.0  # what is further above or below is on another level
POSITION_LIMIT_M = 100.0  # coordinates are clipped to this
SPEED_LIMIT_MPS = 100.0  # speeds are clipped to this


@by_reference
class StopLines(NamedTuple):
    """The town's stop lines (K): all that the prompt tells of signals."""

    pose: Float64  # (K, 4) x, y, z, yaw
    signal: Int32  # (K,) index into State.light
    kind: Int8  # (K,) SignalKind


@by_reference
class PromptRoute(NamedTuple):
    """One ego's route, as the prompt reads it."""

    points: Float64  # (R, 4) x, y, z, yaw
    option: Int8  # (R,) RoadOption
    target: Int32  # (T,) indices of the target points


@by_reference
class Prompt(NamedTuple):
    """What the kernel fills: one array a component. See `observation_space` for the columns."""

    command: Int64  # (1,)
    target_point: Float32  # (3,)
    routing: Float32  # (ROUTING_POINTS, 4)
    map: Float32  # (MAP_POLYLINES, POINTS, 4)
    obstacles: Float32  # (OBSTACLES, 9)
    traffic_lights: Float32  # (LIGHTS, 5)
    stop_signs: Float32  # (STOP_SIGNS, 4)
    speed: Float32  # (1,)
    speed_history: Float32  # (SPEED_HISTORY,)


def stop_lines_of(signals: Signals) -> StopLines:
    """A town's stop lines."""
    kind = signals.kind[signals.stop_signal].astype(np.int8)
    return StopLines(signals.stop_pose, signals.stop_signal, kind)


def prompt_route_of(plan: RoutePlan) -> PromptRoute:
    """The parts of a plan that the prompt reads."""
    return PromptRoute(plan.points, plan.option, plan.targets)


def empty_prompt(*worlds: int) -> Prompt:
    """A prompt to be filled, or those of so many worlds: all zeros."""
    return Prompt(
        command=np.zeros((*worlds, 1), np.int64),
        target_point=np.zeros((*worlds, 3), np.float32),
        routing=np.zeros((*worlds, ROUTING_POINTS, 4), np.float32),
        map=np.zeros((*worlds, MAP_POLYLINES, POINTS, 4), np.float32),
        obstacles=np.zeros((*worlds, OBSTACLES, 9), np.float32),
        traffic_lights=np.zeros((*worlds, LIGHTS, 5), np.float32),
        stop_signs=np.zeros((*worlds, STOP_SIGNS, 4), np.float32),
        speed=np.zeros((*worlds, 1), np.float32),
        speed_history=np.zeros((*worlds, SPEED_HISTORY), np.float32),
    )
