"""Traffic lights and stop signs as boxes: posts, housings, and where each lamp hangs.

Each light shows twice: on its own pole beside the stop line, and over the junction's far side,
where it is seen from the stop line as in North America. Where nothing leads straight on, as from
the stem of a T, the far one stands across the street that the stem ends in.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.sensors.scene.boxes import BoxSpec
from di_envs.sensors.scene.raster import TEXEL_M
from di_envs.sensors.scene.surfaces import ASPHALT, SHOULDER
from di_envs.sensors.scene.tags import Tag
from di_envs.town.lanes import LightState, SignalKind, Turn
from di_envs.town.town import Town

NEAR_HEAD_M, FAR_HEAD_M = 3.4, 5.6  # height of a head's middle
LAMP_HALF_M = 0.17
LAMP_DEPTH_M = 0.03  # half of it
LAMP_SPACING_M = 0.42
_HOUSING = (0.035, 0.04, 0.035)
_STEEL = (0.3, 0.31, 0.33)
_FAR_LIMIT_M = 18.0  # how far from its lane a far pole may stand
_ACROSS_LIMIT_M = 60.0  # how far from the stop line of a stem the other side of the street may be


@by_reference
class Lamps(NamedTuple):
    """All lamps of traffic lights: which signal and state each belongs to, and where it is."""

    signal: NDArray[np.int32]  # (N,)
    state: NDArray[np.int8]  # (N,) LightState in which it is lit
    pose: NDArray[np.float64]  # (N, 4) x, y, z, yaw; it shines against yaw


def signal_boxes(
    town: Town, classes: NDArray[np.uint8], origin: NDArray[np.float64]
) -> tuple[list[BoxSpec], Lamps]:
    """Static boxes of all signals but their poles (which are actors), and the lamps."""
    boxes: list[BoxSpec] = []
    lamps: list[tuple[int, int, float, float, float, float]] = []
    signals = town.signals
    for signal, (kind, pose) in enumerate(zip(signals.kind, signals.pose.tolist(), strict=True)):
        if kind == SignalKind.STOP:
            boxes += _stop_sign(pose)
            continue
        if kind != SignalKind.LIGHT:
            continue
        x, y, z, yaw = pose
        back = 0.3  # the head hangs before its pole
        near = (x - math.cos(yaw) * back, y - math.sin(yaw) * back, z + NEAR_HEAD_M, yaw)
        heads = [near]
        for far in _far_sides(town, signal, classes, origin):
            boxes += far[0]
            heads.append(far[1])
        for head in heads:
            boxes.append(_housing(head))
            lamps += [(signal, *lamp) for lamp in _lamps(head)]
    table = np.array(lamps, np.float64).reshape(-1, 6)
    return boxes, Lamps(
        signal=table[:, 0].astype(np.int32),
        state=table[:, 1].astype(np.int8),
        pose=np.ascontiguousarray(table[:, 2:]),
    )


def _housing(head: tuple[float, float, float, float]) -> BoxSpec:
    x, y, z, yaw = head
    return BoxSpec(
        centre=(x, y, z), half=(0.12, 0.26, 0.72), yaw=yaw, colour=_HOUSING, tag=Tag.TRAFFIC_LIGHT
    )


def _lamps(
    head: tuple[float, float, float, float],
) -> Iterator[tuple[int, float, float, float, float]]:
    """Red above yellow above green, on the side towards the traffic."""
    x, y, z, yaw = head
    fx, fy = x - math.cos(yaw) * 0.13, y - math.sin(yaw) * 0.13
    for row, state in enumerate((LightState.RED, LightState.YELLOW, LightState.GREEN)):
        yield int(state), fx, fy, z + (1 - row) * LAMP_SPACING_M, yaw


def _stop_sign(pose: list[float]) -> list[BoxSpec]:
    """An octagon of two boxes, with a white band."""
    x, y, z, yaw = pose
    x, y = x - math.cos(yaw) * 0.2, y - math.sin(yaw) * 0.2
    red, up = (0.62, 0.04, 0.05), z + 2.3
    c, s = math.cos(yaw) * 0.02, math.sin(yaw) * 0.02
    shapes = (((0.02, 0.42, 0.19), red), ((0.02, 0.31, 0.31), red), ((0.02, 0.19, 0.42), red))
    plates = [
        BoxSpec(centre=(x, y, up), half=half, yaw=yaw, colour=colour, tag=Tag.TRAFFIC_SIGNS)
        for half, colour in shapes
    ]
    band = BoxSpec(
        centre=(x - c, y - s, up),
        half=(0.02, 0.30, 0.09),
        yaw=yaw,
        colour=(0.9, 0.9, 0.9),
        tag=Tag.TRAFFIC_SIGNS,
    )
    return [*plates, band]


def _far_sides(
    town: Town, signal: int, classes: NDArray[np.uint8], origin: NDArray[np.float64]
) -> Iterator[tuple[list[BoxSpec], tuple[float, float, float, float]]]:
    """A pole with an arm beyond the junction, and the head that hangs from it."""
    lanes, signals = town.lanes, town.signals
    stops = np.flatnonzero(signals.stop_signal == signal).tolist()
    ahead = []
    for stop in stops:
        lane = int(signals.stop_lane[stop])
        ways = lanes.successor[lanes.successor_start[lane] : lanes.successor_start[lane + 1]]
        ahead += [int(way) for way in ways if lanes.turn[way] == Turn.STRAIGHT]
    if not ahead:
        if stops:
            yield _across(signals.stop_pose[stops[-1]].tolist(), classes, origin)
        return
    way = ahead[-1]
    x, y, z, yaw = lanes.points[lanes.first[way] + lanes.count[way] - 1].tolist()
    right_x, right_y = -math.sin(yaw), math.cos(yaw)
    x, y = x + math.cos(yaw) * 1.0, y + math.sin(yaw) * 1.0
    out = _to_kerb(x, y, right_x, right_y, _FAR_LIMIT_M, classes, origin) + 0.45
    px, py = x + right_x * out, y + right_y * out
    reach = max(out - 0.3, 0.6)  # over the lane's middle
    pole = BoxSpec(
        centre=(px, py, z + 3.1), half=(0.11, 0.11, 3.1), yaw=yaw, colour=_STEEL, tag=Tag.POLES
    )
    arm = BoxSpec(
        centre=(px - right_x * reach / 2.0, py - right_y * reach / 2.0, z + 6.15),
        half=(0.07, reach / 2.0, 0.07),
        yaw=yaw,
        colour=_STEEL,
        tag=Tag.POLES,
    )
    yield (
        [pole, arm],
        (
            px - right_x * reach - math.cos(yaw) * 0.2,
            py - right_y * reach - math.sin(yaw) * 0.2,
            z + FAR_HEAD_M,
            yaw,
        ),
    )


def _across(
    stop: list[float], classes: NDArray[np.uint8], origin: NDArray[np.float64]
) -> tuple[list[BoxSpec], tuple[float, float, float, float]]:
    """A pole straight ahead of a stop line, beyond the street there, and the head before it."""
    x, y, z, yaw = stop
    c, s = math.cos(yaw), math.sin(yaw)
    begin = 1.0  # past the line itself
    away = begin + _to_kerb(x + begin * c, y + begin * s, c, s, _ACROSS_LIMIT_M, classes, origin)
    px, py = x + c * (away + 0.45), y + s * (away + 0.45)
    high = (FAR_HEAD_M + 0.75) / 2.0
    pole = BoxSpec(
        centre=(px, py, z + high), half=(0.11, 0.11, high), yaw=yaw, colour=_STEEL, tag=Tag.POLES
    )
    return [pole], (px - c * 0.3, py - s * 0.3, z + FAR_HEAD_M, yaw)


def _to_kerb(
    x: float,
    y: float,
    c: float,
    s: float,
    limit_m: float,
    classes: NDArray[np.uint8],
    origin: NDArray[np.float64],
) -> float:
    """How far the road goes on from a place in a direction (c, s), at most `limit_m` [m]."""
    out = 0.0
    while out < limit_m:
        column = int((x + c * out - origin[0]) / TEXEL_M)
        row = int((y + s * out - origin[1]) / TEXEL_M)
        if classes[row, column] not in (ASPHALT, SHOULDER):
            break
        out += TEXEL_M
    return out
