"""What is visible from the car: all that the expert's decisions are made from, as a bundle.

`see` fills it from the world, and no other kernel of the expert takes a `State`. There is no room
in it for what nobody sees from a car: where scenarios will begin, which way others will choose and
who may go first, how long a light stays as it is, who walks along which walkway, who is hidden.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agents.expert.occlusion import Buildings, collect_hiders, is_hidden
from di_envs.numerics.arrays import Float64, Int8, Int64
from di_envs.numerics.bundles import by_reference
from di_envs.numerics.geometry import wrap_angle
from di_envs.numerics.integers import as_int64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import Lanes, Signals
from di_envs.town.queries import nearest_driving_lane_towards, pose_at
from di_envs.world.state import ActorKind, State

CAR = 0  # the row of the car itself
RANGE_M = 100.0  # within which others are seen
POLES_M = 50.0  # and poles
LIGHTS_M = 150.0  # and lights
ON_LANE_M, ALONG_LANE_RAD = 2.0, 0.6  # within which a cyclist rides along a lane

_ABSENT, _BICYCLE = int(ActorKind.ABSENT), int(ActorKind.BICYCLE)
_PROP, _DEBRIS = int(ActorKind.PROP), int(ActorKind.DEBRIS)


@by_reference
class Visible(NamedTuple):
    """The car (row 0) and those in sight (rows below `seen`), of room for A, and lights (S).

    What lies flat on the road and can be driven over is left out.
    """

    seen: Int64  # (1,) rows in use
    kind: Int8  # ActorKind
    x: Float64
    y: Float64
    z: Float64
    yaw: Float64
    speed: Float64
    half_length: Float64
    half_width: Float64
    height: Float64
    brake_light: Int8
    indicator: Int8  # -1 left, 0 off, 1 right
    along_lane: Int8  # of bicycles: 1 on a driving lane, in its direction
    light: Int8  # (S,) LightState; NONE where too far away


def empty_visible(actors: int, signals: int) -> Visible:
    """Room for what is seen; nothing is yet, and what the rows hold means nothing."""
    return Visible(
        seen=np.zeros(1, np.int64),
        kind=np.empty(actors, np.int8),
        x=np.empty(actors),
        y=np.empty(actors),
        z=np.empty(actors),
        yaw=np.empty(actors),
        speed=np.empty(actors),
        half_length=np.empty(actors),
        half_width=np.empty(actors),
        height=np.empty(actors),
        brake_light=np.empty(actors, np.int8),
        indicator=np.empty(actors, np.int8),
        along_lane=np.empty(actors, np.int8),
        light=np.empty(signals, np.int8),
    )


@kernel
def see(
    state: State,
    lanes: Lanes,
    signals: Signals,
    buildings: Buildings,
    ego: int,
    through_walls: bool,
    visible: Visible,
) -> None:
    """Fills `visible` with what is in sight of a car.

    Args:
        state: The world.
        lanes: The town's lanes.
        signals: Its signals.
        buildings: What stands beside its roads.
        ego: The car.
        through_walls: Whether nobody hides anybody from it.
        visible: Overwritten.
    """
    kind, x, y = state.kind, state.x, state.y
    bodies = np.empty(kind.size, np.int32)
    walls = np.empty(buildings.x.size, np.int32)
    n, m = collect_hiders(state, buildings, ego, RANGE_M, bodies, walls)
    bodies, walls = bodies[:n], walls[:m]
    _show(state, lanes, ego, visible, CAR)
    row, ego_x, ego_y = CAR + 1, x[ego], y[ego]
    for actor in range(kind.size):
        if actor == ego or kind[actor] == _ABSENT or kind[actor] == _DEBRIS:
            continue
        dx, dy = x[actor] - ego_x, y[actor] - ego_y
        reach = POLES_M if kind[actor] == _PROP else RANGE_M
        if dx * dx + dy * dy > reach * reach:
            continue
        if not through_walls and kind[actor] != _PROP:  # the map knows the poles
            if is_hidden(state, buildings, ego, actor, bodies, walls):
                continue
        _show(state, lanes, actor, visible, row)
        row += 1
    visible.seen[0] = row
    _show_lights(state.light, signals.pose, ego_x, ego_y, visible.light)


@kernel
def _show_lights(light: Int8, pose: Float64, x: float, y: float, out: Int8) -> None:
    """Copies the colours of the lights (S,) at poses (S, 4) that are near a place."""
    for signal in range(light.size):
        dx, dy = pose[signal, 0] - x, pose[signal, 1] - y
        out[signal] = light[signal] if dx * dx + dy * dy < LIGHTS_M * LIGHTS_M else 0


@kernel
def _show(state: State, lanes: Lanes, actor: int, visible: Visible, row: int) -> None:
    """Copies what is seen of an actor into a row."""
    visible.kind[row] = state.kind[actor]
    visible.x[row] = state.x[actor]
    visible.y[row] = state.y[actor]
    visible.z[row] = state.z[actor]
    visible.yaw[row] = state.yaw[actor]
    visible.speed[row] = state.speed[actor]
    visible.half_length[row] = state.half_length[actor]
    visible.half_width[row] = state.half_width[actor]
    visible.height[row] = state.height[actor]
    visible.brake_light[row] = state.brake_light[actor]
    visible.indicator[row] = state.indicator[actor]
    rides = state.kind[actor] == _BICYCLE and _is_along_lane(state, lanes, actor)
    visible.along_lane[row] = 1 if rides else 0


@kernel
def _is_along_lane(state: State, lanes: Lanes, actor: int) -> bool:
    """Whether somebody is on a driving lane, in its direction."""
    x, y, z, yaw = state.x[actor], state.y[actor], state.z[actor], state.yaw[actor]
    found = nearest_driving_lane_towards(lanes, x, y, z, yaw, ON_LANE_M)
    if found.lane < 0:
        return False
    along = pose_at(lanes, as_int64(found.lane), found.station_m)[3]
    return abs(wrap_angle(yaw - along)) < ALONG_LANE_RAD
