"""The prompt as numbers for small networks: scaled, and each row told where it lies on the route.

Strung together as they are, the prompt's metres and radians and empty rows teach a small network
little. Here lengths and speeds are divided by what is usual, the route is read at twelve of its
points, and each obstacle, light and stop sign says how far along the route and how far off it
stands. `preset="flat"` lays all of it out in one vector, for NumPy; `wrappers.prompt_features`
gives it to networks that read row by row, for torch, from the prompt or from that vector. The
functions are the same for both: `xp` is the library, and every array may have leading axes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.arrays import Float32
from di_envs.numerics.kernels import kernel
from di_envs.prompt import OBSTACLES
from di_envs.world.kinds import ActorKind

ROUTE_SAMPLES = (0, 2, 4, 6, 8, 11, 14, 18, 23, 29, 37, 47)  # of the 50 points at 1 m
OBSTACLES_READ = OBSTACLES // 2  # the nearest
NOT_THERE_M = 1e3  # added to how far a point is that is not there
OFF_ROUTE_M = 20.0  # what is further off than this is just far away
KEYS = (
    "command",
    "target_point",
    "routing",
    "obstacles",
    "traffic_lights",
    "stop_signs",
    "speed",
    "speed_history",
)  # what is read: `map` and `prompt_present` are not among them
FLAT_NUMBERS = 364  # of `flat_numbers`
_STRAIGHT = 7 + 4 + 1 + 4 + 4 * len(ROUTE_SAMPLES)
_TABLES = ((OBSTACLES_READ, 11), (8, 9), (4, 6))  # rows and columns, in the order of the vector


class PromptNumbers(NamedTuple):
    """What `prompt_numbers` gives; rows of tables come with whether they are there."""

    straight: Any  # (..., 64) command, target point, speeds, route
    obstacles: Any  # (..., 16, 11) place, size, velocity, whether it walks
    obstacles_valid: Any  # (..., 16, 1)
    lights: Any  # (..., 8, 9) place, which of three states
    lights_valid: Any  # (..., 8, 1)
    signs: Any  # (..., 4, 6) place
    signs_valid: Any  # (..., 4, 1)


def prompt_numbers(prompt: Mapping[str, Any], xp: Any) -> PromptNumbers:
    """The numbers of a prompt, or of many.

    Args:
        prompt: The entries `KEYS`, in the ego's frame, with any leading axes; `command` one-hot.
        xp: The library of the arrays: `numpy` or `torch`.
    """
    routing = prompt["routing"]
    obstacles = prompt["obstacles"][..., :OBSTACLES_READ, :]
    lights, signs = prompt["traffic_lights"], prompt["stop_signs"]
    return PromptNumbers(
        straight=_straight(prompt, xp),
        obstacles=_obstacles(obstacles, routing, xp),
        obstacles_valid=obstacles[..., 8:9],
        lights=_lights(lights, routing, xp),
        lights_valid=lights[..., 4:5],
        signs=_place(signs, routing, xp),
        signs_valid=signs[..., 3:4],
    )


def flat_numbers(numbers: PromptNumbers, xp: Any) -> Any:
    """(..., 364) all of them in one row; of rows that are not there, zeros."""
    tables = (
        (numbers.obstacles, numbers.obstacles_valid),
        (numbers.lights, numbers.lights_valid),
        (numbers.signs, numbers.signs_valid),
    )
    rows = [_laid_out(xp.concatenate([rows * valid, valid], -1)) for rows, valid in tables]
    return xp.concatenate([numbers.straight, *rows], -1)


def numbers_of(flat: Any) -> PromptNumbers:
    """What `flat_numbers` laid out in (..., 364) numbers: views of them, table by table.

    Rows that are not there are zeros; in the prompt's own they may be anything.
    """
    tables, begin = [], _STRAIGHT
    for rows, columns in _TABLES:
        end = begin + rows * (columns + 1)
        table = flat[..., begin:end].reshape((*flat.shape[:-1], rows, columns + 1))
        tables += [table[..., :columns], table[..., columns:]]
        begin = end
    return PromptNumbers(flat[..., :_STRAIGHT], *tables)


def _straight(prompt: Mapping[str, Any], xp: Any) -> Any:
    """(..., 7 + 4 + 1 + 4 + 48): what is no table of things on the road."""
    target = prompt["target_point"]
    x, y, yaw = target[..., 0], target[..., 1], target[..., 2]
    parts = [
        prompt["command"],
        xp.stack([x / 50.0, y / 50.0, xp.cos(yaw), xp.sin(yaw)], -1),
        prompt["speed"] / 10.0,
        prompt["speed_history"] / 10.0,
        _laid_out(_route(prompt["routing"], xp)),
    ]
    return xp.concatenate(parts, -1)


def _route(routing: Any, xp: Any) -> Any:
    """(..., 50, 4) to (..., samples, 4): x, y, sine of the yaw, valid."""
    chosen = routing[..., list(ROUTE_SAMPLES), :]
    x, y, yaw, valid = (chosen[..., column] for column in range(4))
    return xp.stack([x / 30.0, y / 10.0, xp.sin(yaw), valid], -1)


def _obstacles(table: Any, routing: Any, xp: Any) -> Any:
    size, velocity = table[..., 3:5] / 5.0, table[..., 5:7] / 10.0
    walks = _where_equal(table[..., 7:8], ActorKind.WALKER, table)
    return xp.concatenate([_place(table, routing, xp), size, velocity, walks], -1)


def _lights(table: Any, routing: Any, xp: Any) -> Any:
    states = [_where_equal(table[..., 3:4], state, table) for state in (1, 2, 3)]
    return xp.concatenate([_place(table, routing, xp), *states], -1)


def _place(table: Any, routing: Any, xp: Any) -> Any:
    """(..., K, 6): x, y, direction, and where on the route and how far off it a row's place is.

    Args:
        table: (..., K, ≥3) x, y [m] and yaw first, in the ego frame.
        routing: (..., 50, 4) the route's next points.
        xp: The library.
    """
    x, y, yaw = table[..., 0], table[..., 1], table[..., 2]
    off_m, point = to_route_of_arrays(x, y, routing) if xp is np else to_route(x, y, routing, xp)
    nearest = xp.clip(off_m, None, OFF_ROUTE_M) / OFF_ROUTE_M
    along = (point + 0.0 * x) / routing.shape[-2]
    return xp.stack([x / 40.0, y / 40.0, xp.cos(yaw), xp.sin(yaw), along, nearest], -1)


def to_route(x: Any, y: Any, routing: Any, xp: Any) -> tuple[Any, Any]:
    """(..., K) metres from places to the nearest of the route's points, and which one that is."""
    off_m = xp.hypot(
        x[..., None] - routing[..., None, :, 0], y[..., None] - routing[..., None, :, 1]
    )  # (..., K, 50)
    off_m = off_m + NOT_THERE_M * (1.0 - routing[..., None, :, 3])
    return xp.amin(off_m, -1), xp.argmin(off_m, -1)


def to_route_of_arrays(x: Any, y: Any, routing: Any) -> tuple[Any, Any]:
    """The same bits of arrays in single precision, without the (..., K, 50) between."""
    off_m, point = np.empty(x.shape, np.float32), np.empty(x.shape, np.int64)
    rows = (-1, x.shape[-1])
    seek_on_route(
        np.ascontiguousarray(x).reshape(rows),
        np.ascontiguousarray(y).reshape(rows),
        np.ascontiguousarray(routing).reshape((-1, *routing.shape[-2:])),
        off_m.reshape(rows),
        point.reshape(rows),
    )
    return off_m, point


@kernel
def seek_on_route(
    x: Float32, y: Float32, routing: Float32, off_m: Float32, point: NDArray[np.int64]
) -> None:
    """Writes how far off the route's nearest point each of many places is, and which that is.

    Args:
        x: (N, K) ahead of the ego [m].
        y: (N, K) to its right.
        routing: (N, P, 4) of each ego: x, y, yaw, whether the point is there.
        off_m: (N, K) written.
        point: (N, K) written.
    """
    for n in range(x.shape[0]):
        for k in range(x.shape[1]):
            point[n, k] = 0
            off_m[n, k] = _off(x[n, k], y[n, k], routing[n, 0])
            for p in range(1, routing.shape[1]):
                off = _off(x[n, k], y[n, k], routing[n, p])
                if off < off_m[n, k]:
                    off_m[n, k], point[n, k] = off, p


@kernel
def _off(x: np.float32, y: np.float32, point: Float32) -> np.float32:
    """As far as `hypot` says in single precision: it squares and adds in double."""
    dx, dy = np.float64(x - point[0]), np.float64(y - point[1])
    missing = np.float32(NOT_THERE_M) * (np.float32(1.0) - point[3])
    return np.float32(math.sqrt(dx * dx + dy * dy)) + missing


def _laid_out(rows: Any) -> Any:
    """(..., K, F) to (..., K * F)."""
    return rows.reshape((*rows.shape[:-2], -1))


def _where_equal(values: Any, to: int, like: Any) -> Any:
    """1.0 where values are equal to a number, else 0.0, of the type of `like`."""
    return (values == to) + 0.0 * like[..., :1]
