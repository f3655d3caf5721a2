"""The structured prompt: what a driver is told about the world, as fixed-size arrays.

Nine components, each of which tells only its own story: the map, the obstacles, the lights and the
signs are chosen by distance and never by the route, obstacles move over the ground and not relative
to the ego, and past speeds leave the present one out. So to drop or edit one takes away just that.
Everything is in the ego frame (x ahead, y right; yaw relative to the ego's). What is more than 3 m
above or below the ego, as on a bridge, is left out, except the route's own points.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.numerics.geometry import to_local, wrap_angle
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import SignalKind, Signals
from di_envs.town.map_chunks import CELL_M, POINTS, RANGE_M, MapChunks
from di_envs.town.plan import RoutePlan
from di_envs.world.state import HISTORY_LENGTH, HISTORY_TICKS, SPEED_HISTORY, ActorKind

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

_ABSENT, _PROP = int(ActorKind.ABSENT), int(ActorKind.PROP)
_NO_OPTION, _LAST_OPTION = 0, 6
_LIGHT, _STOP = int(SignalKind.LIGHT), int(SignalKind.STOP)


@by_reference
class StopLines(NamedTuple):
    """The town's stop lines (K): all that the prompt tells of signals."""

    pose: NDArray[np.float64]  # (K, 4) x, y, z, yaw
    signal: NDArray[np.int32]  # (K,) index into State.light
    kind: NDArray[np.int8]  # (K,) SignalKind


@by_reference
class PromptRoute(NamedTuple):
    """One ego's route, as the prompt reads it."""

    points: NDArray[np.float64]  # (R, 4) x, y, z, yaw
    option: NDArray[np.int8]  # (R,) RoadOption
    target: NDArray[np.int32]  # (T,) indices of the target points


@by_reference
class Prompt(NamedTuple):
    """What the kernel fills: one array a component. See `observation_space` for the columns."""

    command: NDArray[np.int64]  # (1,)
    target_point: NDArray[np.float32]  # (3,)
    routing: NDArray[np.float32]  # (ROUTING_POINTS, 4)
    map: NDArray[np.float32]  # (MAP_POLYLINES, POINTS, 4)
    obstacles: NDArray[np.float32]  # (OBSTACLES, 9)
    traffic_lights: NDArray[np.float32]  # (LIGHTS, 5)
    stop_signs: NDArray[np.float32]  # (STOP_SIGNS, 4)
    speed: NDArray[np.float32]  # (1,)
    speed_history: NDArray[np.float32]  # (SPEED_HISTORY,)


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


@kernel
def fill_prompt(state, route, stop_lines, chunks, ego, out):
    """Writes an ego's prompt.

    Args:
        state: `State` of the world.
        route: `PromptRoute` of the ego.
        stop_lines: `StopLines` of the town.
        chunks: `MapChunks` of the town.
        ego: The ego's index.
        out: `Prompt` to write; every entry of it is written.
    """
    pose = (state.x[ego], state.y[ego], state.yaw[ego])
    z = state.z[ego]
    fill_target(route, state.target_index[ego], pose, out.command, out.target_point)
    fill_routing(route.points, state.route_index[ego], pose, out.routing)
    fill_map(chunks, pose, z, out.map)
    fill_obstacles(state, ego, pose, z, out.obstacles)
    fill_traffic_lights(stop_lines, state.light, pose, z, out.traffic_lights)
    fill_stop_signs(stop_lines, pose, z, out.stop_signs)
    out.speed[0] = clipped(state.speed[ego], SPEED_LIMIT_MPS)
    fill_speed_history(state.speed_history[ego], state.tick[()], out.speed_history)


@kernel
def clipped(value, limit):
    """A value moved into [-limit, limit]."""
    return min(max(value, -limit), limit)


@kernel
def place(pose, x, y, row):
    """Writes a world point [m], seen from a pose, into the first two columns of a row."""
    ahead, right = to_local(x, y, pose[0], pose[1], pose[2])
    row[0] = clipped(ahead, POSITION_LIMIT_M)
    row[1] = clipped(right, POSITION_LIMIT_M)


@kernel
def fill_target(route, target_index, pose, command, target_point):
    """The next target point and the road option there; the last one when all are passed."""
    command[0] = _NO_OPTION
    target_point[:] = 0.0
    if route.target.size == 0:
        return
    point = route.target[min(max(target_index, 0), route.target.size - 1)]
    option = route.option[point]
    if 0 < option <= _LAST_OPTION:
        command[0] = option
    place(pose, route.points[point, 0], route.points[point, 1], target_point)
    target_point[2] = wrap_angle(route.points[point, 3] - pose[2])


@kernel
def fill_routing(points, route_index, pose, out):
    """The points after the one that the ego has reached: x, y, yaw, valid."""
    for slot in range(ROUTING_POINTS):
        point = route_index + 1 + slot
        if point < points.shape[0]:
            place(pose, points[point, 0], points[point, 1], out[slot])
            out[slot, 2] = wrap_angle(points[point, 3] - pose[2])
            out[slot, 3] = 1.0
        else:
            out[slot, :] = 0.0


@kernel
def insert_nearest(distance, chosen, count, new_distance, new):
    """Puts a candidate into a list sorted by distance, of fixed size; returns the new count.

    Equal distances keep the order in which they came.
    """
    size = distance.size
    if count == size:
        if new_distance >= distance[size - 1]:
            return count
        slot = size - 1
    else:
        slot = count
        count += 1
    while slot > 0 and distance[slot - 1] > new_distance:
        distance[slot] = distance[slot - 1]
        chosen[slot] = chosen[slot - 1]
        slot -= 1
    distance[slot] = new_distance
    chosen[slot] = new
    return count


@kernel
def chunk_distance(points, x, y, z):
    """Squared distance from a place to a polyline's nearest point on its level [m2]."""
    nearest = np.inf
    for point in range(POINTS):
        if abs(points[point, 2] - z) <= LEVEL_M:
            dx, dy = points[point, 0] - x, points[point, 1] - y
            nearest = min(nearest, dx * dx + dy * dy)
    return nearest


@kernel
def fill_map(chunks, pose, z, out):
    """The polylines nearest to the ego: x, y, kind, valid for each point."""
    distance = np.empty(MAP_POLYLINES)
    chosen = np.empty(MAP_POLYLINES, np.int64)
    count = 0
    column = math.floor((pose[0] - chunks.grid_origin[0]) / CELL_M)
    row = math.floor((pose[1] - chunks.grid_origin[1]) / CELL_M)
    if 0 <= column < chunks.grid_size[0] and 0 <= row < chunks.grid_size[1]:
        cell = row * chunks.grid_size[0] + column
        limit = RANGE_M
        for entry in range(chunks.cell_start[cell], chunks.cell_start[cell + 1]):
            chunk = chunks.cell_chunk[entry]
            dx, dy = chunks.centre[chunk, 0] - pose[0], chunks.centre[chunk, 1] - pose[1]
            reach = limit + chunks.radius_m[chunk]
            if dx * dx + dy * dy > reach * reach:
                continue
            squared = chunk_distance(chunks.points[chunk], pose[0], pose[1], z)
            if squared <= RANGE_M * RANGE_M:
                count = insert_nearest(distance, chosen, count, squared, chunk)
                if count == MAP_POLYLINES:
                    limit = math.sqrt(distance[count - 1])
    for slot in range(MAP_POLYLINES):
        if slot < count:
            fill_polyline(
                chunks.points[chosen[slot]], chunks.kind[chosen[slot]], pose, z, out[slot]
            )
        else:
            out[slot, :, :] = 0.0


@kernel
def fill_polyline(points, kind, pose, z, out):
    """One polyline; its points on other levels are left empty."""
    for point in range(POINTS):
        if abs(points[point, 2] - z) <= LEVEL_M:
            place(pose, points[point, 0], points[point, 1], out[point])
            out[point, 2] = kind[point]
            out[point, 3] = 1.0
        else:
            out[point, :] = 0.0


@kernel
def fill_obstacles(state, ego, pose, z, out):
    """The nearest others: x, y, yaw, length, width, vx, vy, kind, valid.

    Props are left out: they are the poles of signals, which would give these away.
    """
    distance = np.empty(OBSTACLES)
    chosen = np.empty(OBSTACLES, np.int64)
    count = 0
    for actor in range(state.kind.size):
        if state.kind[actor] == _ABSENT or state.kind[actor] >= _PROP:
            continue
        if actor == ego or abs(state.z[actor] - z) > LEVEL_M:
            continue
        dx, dy = state.x[actor] - pose[0], state.y[actor] - pose[1]
        squared = dx * dx + dy * dy
        if squared <= OBSTACLE_RANGE_M * OBSTACLE_RANGE_M:
            count = insert_nearest(distance, chosen, count, squared, actor)
    for slot in range(OBSTACLES):
        if slot < count:
            fill_obstacle(state, chosen[slot], pose, out[slot])
        else:
            out[slot, :] = 0.0


@kernel
def fill_obstacle(state, actor, pose, out):
    """One actor; its velocity is over the ground, turned into the ego's axes."""
    yaw = wrap_angle(state.yaw[actor] - pose[2])
    speed = clipped(state.speed[actor], SPEED_LIMIT_MPS)
    place(pose, state.x[actor], state.y[actor], out)
    out[2] = yaw
    out[3] = 2.0 * state.half_length[actor]
    out[4] = 2.0 * state.half_width[actor]
    out[5] = speed * math.cos(yaw)
    out[6] = speed * math.sin(yaw)
    out[7] = state.kind[actor]
    out[8] = 1.0


@kernel
def nearest_stop_lines(stop_lines, kind, pose, z, distance, chosen):
    """Chooses the nearest stop lines of signals of a kind; returns how many there are."""
    count = 0
    for line in range(stop_lines.signal.size):
        if stop_lines.kind[line] != kind or abs(stop_lines.pose[line, 2] - z) > LEVEL_M:
            continue
        dx, dy = stop_lines.pose[line, 0] - pose[0], stop_lines.pose[line, 1] - pose[1]
        squared = dx * dx + dy * dy
        if squared <= SIGNAL_RANGE_M * SIGNAL_RANGE_M:
            count = insert_nearest(distance, chosen, count, squared, line)
    return count


@kernel
def fill_traffic_lights(stop_lines, light, pose, z, out):
    """The nearest stop lines of lights: x, y, yaw, state, valid."""
    chosen = np.empty(LIGHTS, np.int64)
    count = nearest_stop_lines(stop_lines, _LIGHT, pose, z, np.empty(LIGHTS), chosen)
    for slot in range(LIGHTS):
        if slot < count:
            line = chosen[slot]
            place(pose, stop_lines.pose[line, 0], stop_lines.pose[line, 1], out[slot])
            out[slot, 2] = wrap_angle(stop_lines.pose[line, 3] - pose[2])
            out[slot, 3] = light[stop_lines.signal[line]]
            out[slot, 4] = 1.0
        else:
            out[slot, :] = 0.0


@kernel
def fill_stop_signs(stop_lines, pose, z, out):
    """The nearest stop lines of stop signs: x, y, yaw, valid."""
    chosen = np.empty(STOP_SIGNS, np.int64)
    count = nearest_stop_lines(stop_lines, _STOP, pose, z, np.empty(STOP_SIGNS), chosen)
    for slot in range(STOP_SIGNS):
        if slot < count:
            line = chosen[slot]
            place(pose, stop_lines.pose[line, 0], stop_lines.pose[line, 1], out[slot])
            out[slot, 2] = wrap_angle(stop_lines.pose[line, 3] - pose[2])
            out[slot, 3] = 1.0
        else:
            out[slot, :] = 0.0


@kernel
def fill_speed_history(ring, tick, out):
    """The speeds 0.5 s, 1 s, … ago, never the present one; 0 before the episode began."""
    for past in range(SPEED_HISTORY):
        then = tick - (past + 1) * HISTORY_TICKS
        out[past] = clipped(ring[then % HISTORY_LENGTH], SPEED_LIMIT_MPS) if then >= 0 else 0.0


__all__ = ["COMPONENTS", "MapChunks", "Prompt", "PromptRoute", "StopLines", "fill_prompt"]
