"""What truly lies in each BEV cell: the teacher of the BEV features.

Road and lines come from the ground that cameras see, so the teacher never names what is not shown.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from agents.driveinsight.semantics import BevClass
from agents.networks.grid import GridConfig
from di_envs.numerics.arrays import Float64, UInt8
from di_envs.numerics.kernels import kernel
from di_envs.sensors.scene.raster import TEXEL_M, Raster, Rectangle
from di_envs.sensors.scene.scene import scene_of
from di_envs.sensors.scene.tags import TAG_BITS, Tag
from di_envs.town.lanes import SignalKind
from di_envs.world.kinds import ActorKind
from di_envs.world.state import State
from di_envs.world.struck import footprint
from di_envs.world.world import WorldView

SAMPLES = 4  # places looked at along each side of a cell
LEVEL_M = 3.0
STOP_DEPTH_M = 1.6  # of what is marked before a stop line: a line alone is thinner than a cell

_ROAD, _LINE, _STOP = int(BevClass.ROAD), int(BevClass.LINE), int(BevClass.STOP)
_VEHICLE, _WALKER_CLASS = int(BevClass.VEHICLE), int(BevClass.WALKER)
_ROADS, _ROAD_LINES, _BRIDGE = int(Tag.ROADS), int(Tag.ROAD_LINES), int(Tag.BRIDGE)
_TAG_MASK = (1 << TAG_BITS) - 1
_ABSENT, _WALKER, _PROP = int(ActorKind.ABSENT), int(ActorKind.WALKER), int(ActorKind.PROP)
_YIELD = int(SignalKind.YIELD)


def bev_semantics(view: WorldView, grid: GridConfig) -> NDArray[np.uint8]:
    """(X, Y) `BevClass` of each cell of the ego's grid."""
    out = np.zeros((grid.cells, grid.cells), np.uint8)
    scene, state = scene_of(view.town), view.state
    sides = np.array([grid.x_min_m, grid.y_min_m, grid.cell_x_m, grid.cell_y_m])
    z = float(state.z[0])
    raster = scene.deck if z - float(scene.base_z[0]) > LEVEL_M else scene.ground
    pose = np.array([state.x[0], state.y[0], z, state.yaw[0]])
    _ground(raster, pose, sides, out)
    signals = view.town.signals
    for row in np.flatnonzero(signals.kind[signals.stop_signal] != _YIELD):
        x, y, height, yaw = signals.stop_pose[row]
        if abs(height - z) < LEVEL_M:
            half, back = 0.5 * signals.stop_width_m[row], 0.5 * STOP_DEPTH_M
            x, y = x - back * math.cos(yaw), y - back * math.sin(yaw)
            line = Rectangle(float(x), float(y), float(yaw), back, float(half))
            mark_box(line, pose, sides, _STOP, out)
    _actors(state, pose, sides, out)
    return out


@kernel
def _ground(raster: Raster, pose: Float64, sides: Float64, out: UInt8) -> None:
    """Road where most of a cell is, a line where two samples or more meet one.

    Args:
        raster: Of the level that the ego is on.
        pose: (4,) x, y, z, yaw of the ego.
        sides: (4,) least x and y of the grid in the ego's frame, and a cell's sides, [m].
        out: (X, Y) `BevClass`, written.
    """
    c, s = math.cos(pose[3]), math.sin(pose[3])
    width, height = raster.width[0], raster.height[0]
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            road, line = 0, 0
            for a in range(SAMPLES):
                for b in range(SAMPLES):
                    # no two on a line along or across: a painted line is thinner than their gaps
                    ahead = sides[0] + (i + (a + (b + 0.5) / SAMPLES) / SAMPLES) * sides[2]
                    right = sides[1] + (j + (b + (a + 0.5) / SAMPLES) / SAMPLES) * sides[3]
                    x = pose[0] + c * ahead - s * right - raster.origin[0]
                    y = pose[1] + s * ahead + c * right - raster.origin[1]
                    column, row = int(x / TEXEL_M), int(y / TEXEL_M)
                    if x < 0.0 or y < 0.0 or column >= width or row >= height:
                        continue
                    texel = raster.texels[raster.start[0] + row * width + column]
                    tag = (texel >> np.uint32(24)) & np.uint32(_TAG_MASK)
                    road += tag in (_ROADS, _ROAD_LINES, _BRIDGE)
                    line += tag == _ROAD_LINES
            if 2 * road >= SAMPLES * SAMPLES:
                out[i, j] = _LINE if line >= 2 else _ROAD


@kernel
def _actors(state: State, pose: Float64, sides: Float64, out: UInt8) -> None:
    """Marks everybody but the ego; arguments as for `_ground`."""
    for actor in range(1, state.kind.size):
        kind = state.kind[actor]
        if kind == _ABSENT or kind >= _PROP or abs(state.z[actor] - pose[2]) > LEVEL_M:
            continue
        class_ = _WALKER_CLASS if kind == _WALKER else _VEHICLE
        half_length, half_width = footprint(state, actor)
        box = Rectangle(state.x[actor], state.y[actor], state.yaw[actor], half_length, half_width)
        mark_box(box, pose, sides, class_, out)


@kernel
def mark_box(box: Rectangle, pose: Float64, sides: Float64, class_: int, out: UInt8) -> None:
    """Marks the cells whose middles lie in a box, or the one that holds its middle."""
    c, s = math.cos(pose[3]), math.sin(pose[3])
    dx, dy = box.x - pose[0], box.y - pose[1]
    ahead, right = c * dx + s * dy, c * dy - s * dx
    turn = box.yaw - pose[3]
    c, s = math.cos(turn), math.sin(turn)
    half_length, half_width = box.half_length, box.half_width
    reach = math.sqrt(half_length * half_length + half_width * half_width)
    own_i = math.floor((ahead - sides[0]) / sides[2])
    own_j = math.floor((right - sides[1]) / sides[3])
    for i in range(
        max(0, int((ahead - reach - sides[0]) / sides[2])),
        min(out.shape[0], int((ahead + reach - sides[0]) / sides[2]) + 1),
    ):
        for j in range(
            max(0, int((right - reach - sides[1]) / sides[3])),
            min(out.shape[1], int((right + reach - sides[1]) / sides[3]) + 1),
        ):
            u = sides[0] + (i + 0.5) * sides[2] - ahead
            v = sides[1] + (j + 0.5) * sides[3] - right
            inside = abs(c * u + s * v) <= half_length and abs(c * v - s * u) <= half_width
            if inside or (i == own_i and j == own_j):
                out[i, j] = class_
