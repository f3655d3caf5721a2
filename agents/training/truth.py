"""What truly is there, in the rows that perception says: its targets, and a stand-in for it.

Rows have the columns of `agents.driveinsight.seen`. Of objects the last one says whether the car
could see them; of signals there is at most one, that which governs the car's own lane.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from agents.driveinsight.heads import CLASS_OF_KIND, KIND_OF_CLASS
from agents.driveinsight.perception_losses import IGNORED, OTHERS
from agents.driveinsight.seen import OBJECT_COLUMNS, SIGNAL_COLUMNS
from agents.expert.occlusion import Buildings, buildings_of, collect_hiders, is_hidden
from agents.networks.grid import GridConfig
from agents.training.bev_teacher import mark_box
from di_envs.numerics.arrays import Float32, Float64
from di_envs.numerics.geometry import to_local, wrap_angle
from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.prompt import LEVEL_M
from di_envs.prompt_surroundings import fill_obstacle
from di_envs.sensors.camera.config import CameraConfig
from di_envs.sensors.scene.raster import Rectangle
from di_envs.sensors.scene.scene import scene_of
from di_envs.town.lanes import Lanes, LightState, SignalKind, Signals
from di_envs.town.queries import nearest_driving_lane_towards, pose_at
from di_envs.world.state import ActorKind, State
from di_envs.world.world import WorldView

LAMPS = 8  # that are told: the heads of one signal are two
LAMPS_M, TOWARDS = (
    100.0,
    0.4,
)  # within which others are; cosine of the angle that they are turned away
SIGN_M = 2.3  # above its pole's foot hangs a stop sign
SIGNAL_AHEAD_M = 50.0  # along the lane, up to which a stop line governs the car
ON_LANE_M = 3.0  # from a lane's middle, within which the car is on it

# By `ActorKind`: which of the kinds that eyes tell apart it looks like
_KIND_SEEN = np.array(
    [int(KIND_OF_CLASS[CLASS_OF_KIND[k]]) if k in CLASS_OF_KIND else int(k) for k in ActorKind]
)
_ABSENT, _PROP = int(ActorKind.ABSENT), int(ActorKind.PROP)
_LIGHT, _STOP = int(SignalKind.LIGHT), int(SignalKind.STOP)
_STATE_OF_LIGHT = np.array([-1, 2, 1, 0])  # by `LightState`
_STOP_STATE = 3
_RED, _YELLOW, _GREEN = int(LightState.RED), int(LightState.YELLOW), int(LightState.GREEN)


def seen_truth(
    view: WorldView, grid: GridConfig
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Who is on the grid, and the signal that governs the ego's lane.

    Args:
        view: Of the world.
        grid: Of the ego; whose middle lies outside it is left out, as is who is on another level.

    Returns:
        Objects (N, 9), in the order of actors, of kinds that eyes tell apart (car, bicycle,
        walker), the last column 1 for those in sight and 0 for those hidden behind others or
        buildings; and signals (M, 8), M being 0 or 1.
    """
    state, town = view.state, view.town
    sides = np.array([grid.x_min_m, grid.x_max_m, grid.y_min_m, grid.y_max_m])
    objects = np.zeros((state.kind.size, OBJECT_COLUMNS), np.float32)
    count = _fill_objects(state, buildings_of(town), sides, objects)
    objects[:count, 7] = _KIND_SEEN[objects[:count, 7].astype(np.int64)]
    signals = np.zeros((1, SIGNAL_COLUMNS), np.float32)
    line = governing_line(state, town.lanes, town.signals)
    if line >= 0:
        _fill_signal(state, town.signals, line, signals[0])
    return objects[:count], signals[: int(line >= 0)]


@kernel
def _fill_objects(state: State, buildings: Buildings, sides: Float64, out: Float32) -> int:
    """Fills rows with those on the grid; returns how many.

    Args:
        state: The world.
        buildings: Of the town.
        sides: (4,) least and greatest x, least and greatest y of the grid, ego frame [m].
        out: (A, 9) zeros, written.
    """
    kind, n = state.kind, 0
    pose = (state.x[0], state.y[0], state.yaw[0])
    bodies = np.empty(kind.size, np.int32)
    walls = np.empty(buildings.x.size, np.int32)
    reach = math.hypot(max(sides[1], -sides[0]), max(sides[3], -sides[2]))
    found, stand = collect_hiders(state, buildings, 0, reach, bodies, walls)
    for actor in range(1, kind.size):
        if kind[actor] == _ABSENT or kind[actor] >= _PROP:
            continue
        if abs(state.z[actor] - state.z[0]) > LEVEL_M:
            continue
        ahead, right = to_local(state.x[actor], state.y[actor], pose[0], pose[1], pose[2])
        if not (sides[0] <= ahead < sides[1] and sides[2] <= right < sides[3]):
            continue
        fill_obstacle(state, actor, pose, out[n])
        if is_hidden(state, buildings, 0, actor, bodies[:found], walls[:stand]):
            out[n, 8] = 0.0
        n += 1
    return n


@kernel
def governing_line(state: State, lanes: Lanes, signals: Signals) -> int:
    """The stop line at which the ego's own lane ends next, -1 for none.

    It is looked for along the lane and those that it leads to, up to where there is a choice:
    which way the ego will take cannot be seen. Inside a junction lanes that part lie on each other,
    so nothing governs there before the ego has left it, nor against the lane's direction. A line of
    a sign to yield does not count.
    """
    here = (state.x[0], state.y[0], state.z[0])
    found = nearest_driving_lane_towards(lanes, here[0], here[1], here[2], state.yaw[0], ON_LANE_M)
    lane = as_int64(found.lane)
    if lane < 0 or (lanes.junction[lane] >= 0 and _is_one_of_several(lanes, lane)):
        return as_int64(-1)
    if math.cos(pose_at(lanes, lane, found.station_m)[3] - state.yaw[0]) <= 0.0:
        return as_int64(-1)
    ahead = lanes.length_m[lane] - found.station_m
    while ahead <= SIGNAL_AHEAD_M:
        line = lanes.stop_line[lane]
        if line >= 0:
            kind = signals.kind[signals.stop_signal[line]]
            return as_int64(line) if kind in (_LIGHT, _STOP) else as_int64(-1)
        first = lanes.successor_start[lane]
        if lanes.successor_start[lane + 1] != first + 1:
            break
        lane = as_int64(lanes.successor[first])
        ahead += lanes.length_m[lane]
    return as_int64(-1)


@kernel
def _is_one_of_several(lanes: Lanes, lane: int) -> bool:
    """Whether a lane begins where another one begins, too."""
    for n in range(lanes.predecessor_start[lane], lanes.predecessor_start[lane + 1]):
        before = lanes.predecessor[n]
        if lanes.successor_start[before + 1] - lanes.successor_start[before] > 1:
            return True
    return False


@kernel
def _fill_signal(state: State, signals: Signals, line: int, out: Float32) -> None:
    """One stop line, (8,): its place as the ego sees it, and what its signal shows."""
    pose = signals.stop_pose[line]
    out[0], out[1] = to_local(pose[0], pose[1], state.x[0], state.y[0], state.yaw[0])
    out[2] = wrap_angle(pose[3] - state.yaw[0])
    signal = signals.stop_signal[line]
    if signals.kind[signal] == _STOP:
        out[6] = 1.0
    elif state.light[signal] == _RED:
        out[3] = 1.0
    elif state.light[signal] == _YELLOW:
        out[4] = 1.0
    elif state.light[signal] == _GREEN:
        out[5] = 1.0
    out[7] = 1.0


def shown_lamps(view: WorldView, camera: CameraConfig, stride: int) -> NDArray[np.float32]:
    """Where a camera shows lit lamps and stop signs: those of the ego's lane, then others.

    Others may be those that governed it until now, or will: nothing tells them apart by their looks
    alone, so nobody is to be blamed for seeing them.

    Args:
        view: Of the world.
        camera: Of the ego.
        stride: Pixels of the image to one of the map that they are wanted in.

    Returns:
        (LAMPS, 3) row and column in that map, and the state: 0 red, 1 yellow, 2 green, 3 stop sign,
        `OTHERS` more for those that do not govern the lane; -1 for none.
    """
    out = np.full((LAMPS, 3), -1.0, np.float32)
    state, signals = view.state, view.town.signals
    line = governing_line(state, view.town.lanes, signals)
    governing = signals.stop_signal[line] if line >= 0 else -1
    lamps = scene_of(view.town).lamps
    lit = lamps.state == state.light[lamps.signal]
    signs = np.flatnonzero(signals.kind == SignalKind.STOP)
    place = np.concatenate([lamps.pose[lit], signals.pose[signs] + (0.0, 0.0, SIGN_M, 0.0)])
    signal = np.concatenate([lamps.signal[lit], signs])
    shown = np.concatenate([_STATE_OF_LIGHT[lamps.state[lit]], np.full(len(signs), _STOP_STATE)])
    away = np.hypot(place[:, 0] - state.x[0], place[:, 1] - state.y[0])
    towards = np.cos(place[:, 3] - state.yaw[0]) > TOWARDS
    seen = camera.project(_as_seen(state, place[:, :3]))
    size = np.array([camera.width, camera.height])
    inside = (seen[:, 2] > 0.0) & ((seen[:, :2] >= 0.0) & (seen[:, :2] < size)).all(axis=1)
    chosen = np.flatnonzero(inside & towards & (away < LAMPS_M))
    order = np.lexsort((away[chosen], signal[chosen] != governing))
    chosen = chosen[order][:LAMPS]
    out[: len(chosen), :2] = seen[chosen, 1::-1] / stride
    out[: len(chosen), 2] = shown[chosen] + OTHERS * (signal[chosen] != governing)
    return out


def _as_seen(state: State, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) places of the world, ahead, right and up of the ego."""
    cos, sin = math.cos(state.yaw[0]), math.sin(state.yaw[0])
    x, y = places[:, 0] - state.x[0], places[:, 1] - state.y[0]
    return np.stack([cos * x + sin * y, cos * y - sin * x, places[:, 2] - state.z[0]], axis=1)


def hidden_cells(
    objects: NDArray[np.float32], grid: GridConfig, semantics: NDArray[np.uint8]
) -> None:
    """Marks the cells of those who are hidden as `IGNORED`: nobody can be asked for them.

    Args:
        objects: (N, 9) from `seen_truth`.
        grid: Of both.
        semantics: (X, Y), written.
    """
    sides = np.array([grid.x_min_m, grid.y_min_m, grid.cell_x_m, grid.cell_y_m])
    ego = np.zeros(4)
    for x, y, yaw, length, width in objects[objects[:, 8] == 0.0, :5].tolist():
        mark_box(Rectangle(x, y, yaw, 0.5 * length, 0.5 * width), ego, sides, IGNORED, semantics)
