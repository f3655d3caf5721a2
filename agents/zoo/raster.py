"""The true view from above that teachers drive by: a channel for each thing that is there.

Source: Zhang et al., End-to-End Urban Driving by Imitating a Reinforcement Learning Coach (Roach),
ICCV 2021. What we changed: where others were is not drawn in masks of the past; how fast they are
is drawn where they stand.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from agents.driveinsight.semantics import BevClass
from agents.networks.grid import GridConfig
from agents.training.bev_teacher import LEVEL_M, STOP_DEPTH_M, bev_semantics, mark_box
from di_envs.sensors.scene.raster import Rectangle
from di_envs.town.lanes import LightState, SignalKind
from di_envs.world.kinds import ActorKind
from di_envs.world.world import WorldView

GRID = GridConfig(x_min_m=-8.0, x_max_m=40.0, y_min_m=-24.0, y_max_m=24.0, cells=96)
SPEED_MPS = 10.0  # velocities are told in these
ROUTE_HALF_M = 1.75  # to either side of the route that is drawn
_MOST = 250  # actors whose velocities are drawn: the nearest


class RasterChannel(IntEnum):
    """What a channel shows: 0 or 1 in each cell, velocities [10 m/s] in the last two."""

    ROAD = 0
    LINE = 1
    ROUTE = 2
    VEHICLE = 3
    WALKER = 4
    RED = 5  # the stop line of a red or yellow light
    GREEN = 6
    STOP_SIGN = 7  # the line of one at which the ego has not stopped yet
    AHEAD = 8  # velocity over the ground of who is there
    RIGHT = 9


def true_raster(view: WorldView, routing: NDArray[np.floating]) -> NDArray[np.float32]:
    """The view from above of an ego.

    Args:
        view: Of the world.
        routing: (R, 4) x, y, yaw, valid of the route's next points, 1 m apart, ego frame.

    Returns:
        (10, X, Y) by `RasterChannel`, on `GRID`.
    """
    out = np.zeros((len(RasterChannel), GRID.cells, GRID.cells), np.float32)
    class_ = bev_semantics(view, GRID)
    out[RasterChannel.ROAD] = (class_ >= BevClass.ROAD) & (class_ != BevClass.WALKER)
    out[RasterChannel.LINE] = class_ == BevClass.LINE
    out[RasterChannel.VEHICLE] = class_ == BevClass.VEHICLE
    out[RasterChannel.WALKER] = class_ == BevClass.WALKER
    out[RasterChannel.ROUTE] = _route(routing)
    _signals(view, out)
    _velocities(view, out)
    return out


def _sides() -> NDArray[np.float64]:
    return np.array([GRID.x_min_m, GRID.y_min_m, GRID.cell_x_m, GRID.cell_y_m])


def _blank() -> NDArray[np.uint8]:
    return np.zeros((GRID.cells, GRID.cells), np.uint8)


def _route(routing: NDArray[np.floating]) -> NDArray[np.uint8]:
    mask, ego, sides = _blank(), np.zeros(4), _sides()
    for x, y, yaw in routing[routing[:, 3] > 0.0, :3].tolist():
        mark_box(Rectangle(x, y, yaw, 0.75, ROUTE_HALF_M), ego, sides, 1, mask)
    return mask


def _signals(view: WorldView, out: NDArray[np.float32]) -> None:
    """Stop lines, by what their signals show."""
    state, signals = view.state, view.town.signals
    pose = np.array([state.x[0], state.y[0], state.z[0], state.yaw[0]])
    sides, masks = _sides(), {channel: _blank() for channel in _SHOWN}
    near = np.hypot(signals.stop_pose[:, 0] - pose[0], signals.stop_pose[:, 1] - pose[1]) < 60.0
    near &= np.abs(signals.stop_pose[:, 2] - pose[2]) < LEVEL_M
    for row in np.flatnonzero(near):
        signal = int(signals.stop_signal[row])
        channel = _channel_of(int(signals.kind[signal]), int(state.light[signal]))
        done = bool(state.stop_done[0]) and signal == int(state.stop_target[0])
        if channel is None or (done and channel == RasterChannel.STOP_SIGN):
            continue
        x, y, _, yaw = signals.stop_pose[row].tolist()
        half, back = 0.5 * float(signals.stop_width_m[row]), 0.5 * STOP_DEPTH_M
        box = Rectangle(x - back * math.cos(yaw), y - back * math.sin(yaw), yaw, back, half)
        mark_box(box, pose, sides, 1, masks[channel])
    for channel, mask in masks.items():
        out[channel] = mask


_SHOWN = (RasterChannel.RED, RasterChannel.GREEN, RasterChannel.STOP_SIGN)


def _channel_of(kind: int, shows: int) -> RasterChannel | None:
    if kind == SignalKind.STOP:
        return RasterChannel.STOP_SIGN
    if kind == SignalKind.LIGHT and shows in (LightState.RED, LightState.YELLOW):
        return RasterChannel.RED
    return RasterChannel.GREEN if kind == SignalKind.LIGHT else None


def _velocities(view: WorldView, out: NDArray[np.float32]) -> None:
    """How fast those are who stand in a cell, in the ego's frame."""
    state, sides = view.state, _sides()
    pose = np.array([state.x[0], state.y[0], state.z[0], state.yaw[0]])
    away = np.hypot(state.x - pose[0], state.y - pose[1])
    there = (state.kind != ActorKind.ABSENT) & (state.kind < ActorKind.PROP) & (away < 60.0)
    there &= (np.abs(state.z - pose[2]) <= LEVEL_M) & (state.speed > 0.0)
    there[0] = False
    actors = np.flatnonzero(there)
    actors = actors[np.argsort(away[actors], kind="stable")][:_MOST]
    number = _blank()
    for count, actor in enumerate(actors, start=1):
        box = Rectangle(
            float(state.x[actor]),
            float(state.y[actor]),
            float(state.yaw[actor]),
            float(state.half_length[actor]),
            float(state.half_width[actor]),
        )
        mark_box(box, pose, sides, count, number)
    turn = state.yaw[actors] - pose[3]
    speed = state.speed[actors] / SPEED_MPS
    table = np.zeros((len(actors) + 1, 2), np.float32)
    table[1:] = np.stack([speed * np.cos(turn), speed * np.sin(turn)], axis=1)
    out[RasterChannel.AHEAD], out[RasterChannel.RIGHT] = table[number].transpose(2, 0, 1)
