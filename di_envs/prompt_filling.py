"""How the prompt is written: all of it, and what it tells of the ego itself and its route."""

from __future__ import annotations

from di_envs.numerics.arrays import Float32, Float64, Int64
from di_envs.numerics.geometry import wrap_angle
from di_envs.numerics.kernels import kernel
from di_envs.prompt import ROUTING_POINTS, SPEED_LIMIT_MPS, Prompt, PromptRoute, StopLines
from di_envs.prompt_surroundings import (
    EgoPose,
    clipped,
    fill_map,
    fill_obstacles,
    fill_stop_signs,
    fill_traffic_lights,
    place,
)
from di_envs.town.map_chunks import MapChunks
from di_envs.world.state import HISTORY_LENGTH, HISTORY_TICKS, SPEED_HISTORY, State

_NO_OPTION, _LAST_OPTION = 0, 6


@kernel
def fill_prompt(
    state: State,
    route: PromptRoute,
    stop_lines: StopLines,
    chunks: MapChunks,
    ego: int,
    out: Prompt,
) -> None:
    """Writes an ego's prompt.

    Args:
        state: Of the world.
        route: Of the ego.
        stop_lines: Of the town.
        chunks: The town's map.
        ego: The ego's index.
        out: Written; every entry of it is written.
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
    fill_speed_history(state.speed_history[ego], int(state.tick[()]), out.speed_history)


@kernel
def fill_target(
    route: PromptRoute, target_index: int, pose: EgoPose, command: Int64, target_point: Float32
) -> None:
    """The next target point and the road option there; the last one when all are passed.

    Args:
        route: Of the ego.
        target_index: The next target point, an index into `route.target`.
        pose: Of the ego.
        command: (1,) written: RoadOption, 0 for none.
        target_point: (3,) written: x, y, yaw.
    """
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
def fill_routing(points: Float64, route_index: int, pose: EgoPose, out: Float32) -> None:
    """The points after the one that the ego has reached.

    Args:
        points: (R, 4) x, y, z, yaw of the route, in the world frame.
        route_index: The point reached.
        pose: Of the ego.
        out: (ROUTING_POINTS, 4) written: x, y, yaw, valid.
    """
    for slot in range(ROUTING_POINTS):
        point = route_index + 1 + slot
        if point < points.shape[0]:
            place(pose, points[point, 0], points[point, 1], out[slot])
            out[slot, 2] = wrap_angle(points[point, 3] - pose[2])
            out[slot, 3] = 1.0
        else:
            out[slot, :] = 0.0


@kernel
def fill_speed_history(ring: Float64, tick: int, out: Float32) -> None:
    """The speeds 0.5 s, 1 s, … ago, never the present one; 0 before the episode began.

    Args:
        ring: (HISTORY_LENGTH,) speeds [m/s]; that of a tick is at its remainder.
        tick: The present one.
        out: (SPEED_HISTORY,) written [m/s].
    """
    for past in range(SPEED_HISTORY):
        then = tick - (past + 1) * HISTORY_TICKS
        out[past] = clipped(ring[then % HISTORY_LENGTH], SPEED_LIMIT_MPS) if then >= 0 else 0.0
