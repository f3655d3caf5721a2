"""What the prompt tells of an ego's surroundings: the nearest of the map, of others and of signals.

The nearest are chosen by a list of fixed size that stays sorted, so that the order never depends on
how much there is.
"""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.arrays import Float32, Float64, Int8, Int64
from di_envs.numerics.geometry import to_local, wrap_angle
from di_envs.numerics.kernels import kernel
from di_envs.prompt import (
    LEVEL_M,
    LIGHTS,
    MAP_POLYLINES,
    OBSTACLE_RANGE_M,
    OBSTACLES,
    POSITION_LIMIT_M,
    SIGNAL_RANGE_M,
    SPEED_LIMIT_MPS,
    STOP_SIGNS,
    StopLines,
)
from di_envs.town.lanes import SignalKind
from di_envs.town.map_chunks import CELL_M, POINTS, RANGE_M, MapChunks
from di_envs.world.state import ActorKind, State

EgoPose = tuple[float, float, float]  # x, y [m], yaw of an ego in the world frame

_ABSENT, _PROP = int(ActorKind.ABSENT), int(ActorKind.PROP)
_LIGHT, _STOP = int(SignalKind.LIGHT), int(SignalKind.STOP)


@kernel
def clipped(value: float, limit: float) -> float:
    """A value moved into [-limit, limit]."""
    return min(max(value, -limit), limit)


@kernel
def place(pose: EgoPose, x: float, y: float, row: Float32) -> None:
    """Writes a world point [m], seen from a pose, into the first two columns of a row."""
    ahead, right = to_local(x, y, pose[0], pose[1], pose[2])
    row[0] = clipped(ahead, POSITION_LIMIT_M)
    row[1] = clipped(right, POSITION_LIMIT_M)


@kernel
def insert_nearest(
    distance: Float64, chosen: Int64, count: int, new_distance: float, new: int
) -> int:
    """Puts a candidate into a list sorted by distance, of fixed size; returns the new count.

    Equal distances keep the order in which they came.

    Args:
        distance: (N,) of the list's entries, rising; the first `count` of them are there.
        chosen: (N,) what they are.
        count: How many there are.
        new_distance: The candidate's; squared ones will do.
        new: The candidate.
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
def chunk_distance(points: Float64, x: float, y: float, z: float) -> float:
    """Squared distance [m2] from a place to the nearest point on its level of (POINTS, 3)."""
    nearest = np.inf
    for point in range(POINTS):
        if abs(points[point, 2] - z) <= LEVEL_M:
            dx, dy = points[point, 0] - x, points[point, 1] - y
            nearest = min(nearest, dx * dx + dy * dy)
    return nearest


@kernel
def fill_map(chunks: MapChunks, pose: EgoPose, z: float, out: Float32) -> None:
    """The polylines nearest to the ego: (MAP_POLYLINES, POINTS, 4) x, y, kind, valid."""
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
def fill_polyline(points: Float64, kind: Int8, pose: EgoPose, z: float, out: Float32) -> None:
    """One polyline; its points on other levels are left empty.

    Args:
        points: (POINTS, 3) x, y, z in the world frame.
        kind: (POINTS,) MapKind.
        pose: Of the ego.
        z: Its height [m].
        out: (POINTS, 4) written: x, y, kind, valid.
    """
    for point in range(POINTS):
        if abs(points[point, 2] - z) <= LEVEL_M:
            place(pose, points[point, 0], points[point, 1], out[point])
            out[point, 2] = kind[point]
            out[point, 3] = 1.0
        else:
            out[point, :] = 0.0


@kernel
def fill_obstacles(state: State, ego: int, pose: EgoPose, z: float, out: Float32) -> None:
    """The nearest others: (OBSTACLES, 9) x, y, yaw, length, width, vx, vy, kind, valid.

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
def fill_obstacle(state: State, actor: int, pose: EgoPose, out: Float32) -> None:
    """One actor, (9,); its velocity is over the ground, turned into the ego's axes."""
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
def nearest_stop_lines(
    stop_lines: StopLines, kind: int, pose: EgoPose, z: float, distance: Float64, chosen: Int64
) -> int:
    """Chooses the nearest stop lines of signals of a kind; returns how many there are.

    Args:
        stop_lines: Of the town.
        kind: `SignalKind`.
        pose: Of the ego.
        z: Its height [m].
        distance: (N,) room for squared distances [m2].
        chosen: (N,) written: lines, the nearest first.
    """
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
def fill_traffic_lights(
    stop_lines: StopLines, light: Int8, pose: EgoPose, z: float, out: Float32
) -> None:
    """The nearest stop lines of lights: (LIGHTS, 5) x, y, yaw, state, valid."""
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
def fill_stop_signs(stop_lines: StopLines, pose: EgoPose, z: float, out: Float32) -> None:
    """The nearest stop lines of stop signs: (STOP_SIGNS, 4) x, y, yaw, valid."""
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
