"""What eyes of flesh make of the truth: rows that miss somebody, see ghosts, and are a little off.

A planner that learns from perfect rows would trust every one of them. Each sample has eyes of its
own, from perfect ones to twice as bad as `EyeConfig` says; all draws are keyed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agents.driveinsight.seen import OBJECTS, SIGNALS
from agents.networks.grid import GridConfig
from di_envs.numerics.keyed_arrays import keyed_normals, keyed_uniforms, stream_of
from di_envs.world.kinds import ActorKind

_STREAM = stream_of("eyes of a training sample")
_SMALL = (ActorKind.WALKER, ActorKind.BICYCLE, ActorKind.MOTORCYCLE)
_GHOSTS = ((ActorKind.CAR, 4.5, 2.0), (ActorKind.WALKER, 0.5, 0.5))  # kind, length, width [m]
_X, _Y, _YAW, _SPEEDS, _KIND, _SCORE = 0, 1, 2, slice(5, 7), 7, 8


@dataclass(frozen=True, kw_only=True)
class EyeConfig:
    """How bad eyes are on average; the numbers of one sample are these times 0 to 2.

    Attributes:
        perfect: Share of samples whose rows are the truth.
        missed_at_30_m: How often a vehicle 30 m away is missed; nearer and further in proportion to
            the distance's square, walkers and bicycles as if they were `small` times as far.
        small: See there.
        ghosts: Objects that are not there, on average.
        place_m: Error of a place along either axis; as much again at 30 m.
        yaw_rad: Error of a heading.
        flipped: How often a heading is turned about.
        speed_mps: Error of either component of the velocity.
        signal_missed: How often a signal at 30 m is missed.
        signal_ghost: How often there is one that is none.
        signal_wrong: How often its state is another one.
        signal_m: Error of a stop line's place along either axis.
    """

    perfect: float = 0.2
    missed_at_30_m: float = 0.12
    small: float = 2.0
    ghosts: float = 0.4
    place_m: float = 0.15
    yaw_rad: float = 0.06
    flipped: float = 0.02
    speed_mps: float = 0.5
    signal_missed: float = 0.08
    signal_ghost: float = 0.02
    signal_wrong: float = 0.03
    signal_m: float = 0.5


NO_NOISE = EyeConfig(perfect=1.0)


def seen_through(
    eyes: EyeConfig,
    grid: GridConfig,
    objects: NDArray[np.float32],
    signals: NDArray[np.float32],
    key: int,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """What a batch of samples sees of what truly is in sight.

    Args:
        eyes: How bad they are.
        grid: Where ghosts may be.
        objects: (B, OBJECTS, 9) as in `Seen`, presence 0 or 1.
        signals: (B, SIGNALS, 8) as in `Seen`.
        key: Of all draws.

    Returns:
        The same shapes: by falling score, zeros where there is no more.
    """
    batch = len(objects)
    own = keyed_uniforms(key, _STREAM, 0, (batch, 2))
    level = np.where(own[:, 0] < eyes.perfect, 0.0, 2.0 * own[:, 1])  # (B,)
    blurred = _blurred_objects(eyes, objects, level, key)
    ghosts = _ghosts(eyes, grid, blurred, level, key)
    return _by_score(np.where(ghosts[..., _SCORE:] > 0.0, ghosts, blurred)), _by_score(
        _blurred_signals(eyes, grid, signals, level, key)
    )


def _blurred_objects(
    eyes: EyeConfig, objects: NDArray[np.float32], level: NDArray[np.float64], key: int
) -> NDArray[np.float32]:
    """Objects that are missed, or a little off, with scores that tell a little of how sure it is.

    Args:
        eyes: How bad they are on average.
        objects: (B, OBJECTS, 9).
        level: (B,) what the numbers of `eyes` are multiplied by.
        key: Of all draws.
    """
    batch = len(objects)
    bad = level[:, None]
    drawn = keyed_uniforms(key, _STREAM, 1, (batch, OBJECTS, 3))
    off = keyed_normals(key, _STREAM, 2, (batch, OBJECTS, 7))
    distance = np.hypot(objects[..., _X], objects[..., _Y]) / 30.0
    seeming = distance * np.where(np.isin(objects[..., _KIND], _SMALL), eyes.small, 1.0)
    missed = np.minimum(bad * eyes.missed_at_30_m * seeming**2, 0.95)
    out = objects.astype(np.float64)
    out[..., :2] += (bad * eyes.place_m * (1.0 + distance))[..., None] * off[..., :2]
    out[..., _YAW] += bad * eyes.yaw_rad * off[..., 2]
    out[..., _YAW] += np.pi * (drawn[..., 1] < bad * eyes.flipped)
    out[..., 3:5] *= 1.0 + 0.1 * bad[..., None] * np.clip(off[..., 3:5], -2.0, 2.0)
    out[..., _SPEEDS] += bad[..., None] * eyes.speed_mps * off[..., 5:7]
    sure = 1.0 - np.minimum(0.8, bad * (0.1 + 0.4 * drawn[..., 2]) * np.sqrt(1.0 + seeming))
    out[..., _SCORE] = (objects[..., _SCORE] > 0.0) * (drawn[..., 0] >= missed) * sure
    return _nothing_where(out, _SCORE)


def _ghosts(
    eyes: EyeConfig,
    grid: GridConfig,
    objects: NDArray[np.float32],
    level: NDArray[np.float64],
    key: int,
) -> NDArray[np.float32]:
    """(B, OBJECTS, 9) who is not there, in slots of the last quarter that are empty."""
    batch, slots = len(objects), OBJECTS // 4
    drawn = keyed_uniforms(key, _STREAM, 3, (batch, slots, 6))
    out = np.zeros(objects.shape)
    last = out[:, -slots:]
    last[..., _X] = grid.x_min_m + drawn[..., 0] * (grid.x_max_m - grid.x_min_m)
    last[..., _Y] = grid.y_min_m + drawn[..., 1] * (grid.y_max_m - grid.y_min_m)
    last[..., _YAW] = 2.0 * np.pi * drawn[..., 2]
    kinds = np.array(_GHOSTS, np.float64)[(drawn[..., 3] * len(_GHOSTS)).astype(int)]
    last[..., 3:5], last[..., _KIND] = kinds[..., 1:], kinds[..., 0]
    there = drawn[..., 4] < np.minimum(level * eyes.ghosts / slots, 1.0)[:, None]
    free = objects[:, -slots:, _SCORE] == 0.0
    last[..., _SCORE] = there * free * (0.15 + 0.5 * drawn[..., 5])
    return _nothing_where(out, _SCORE)


def _blurred_signals(
    eyes: EyeConfig,
    grid: GridConfig,
    signals: NDArray[np.float32],
    level: NDArray[np.float64],
    key: int,
) -> NDArray[np.float32]:
    """Signals that are missed, misread or a little off, and some that are none.

    Args:
        eyes: How bad they are on average.
        grid: Where ghosts may be.
        signals: (B, SIGNALS, 8).
        level: (B,) what the numbers of `eyes` are multiplied by.
        key: Of all draws.
    """
    batch = len(signals)
    bad = level[:, None]
    drawn = keyed_uniforms(key, _STREAM, 4, (batch, SIGNALS, 7))
    off = keyed_normals(key, _STREAM, 5, (batch, SIGNALS, 3))
    out = signals.astype(np.float64)
    there = out[..., 7] > 0.0
    ghost = ~there & (drawn[..., 0] < bad * eyes.signal_ghost)
    out[..., 0] = np.where(ghost, 5.0 + drawn[..., 1] * (grid.x_max_m - 10.0), out[..., 0])
    out[..., 1] = np.where(ghost, 4.0 * drawn[..., 2] - 2.0, out[..., 1])
    distance = np.hypot(out[..., 0], out[..., 1]) / 30.0
    wrong = (ghost | (drawn[..., 3] < bad * eyes.signal_wrong))[..., None]
    another = np.eye(4)[(4.0 * drawn[..., 4]).astype(int)]
    blur = np.minimum(0.4, bad * 0.2 * drawn[..., 5])[..., None]
    out[..., 3:7] = np.where(wrong, another, out[..., 3:7]) * (1.0 - blur) + 0.25 * blur
    out[..., :2] += (bad * eyes.signal_m)[..., None] * off[..., :2]
    out[..., 2] += bad * eyes.yaw_rad * off[..., 2]
    missed = drawn[..., 6] < np.minimum(bad * eyes.signal_missed * distance, 0.95)
    out[..., 7] = ((there & ~missed) | ghost) * (1.0 - blur[..., 0])
    return _nothing_where(out, 7)


def _nothing_where(rows: NDArray[np.float64], score: int) -> NDArray[np.float32]:
    """Rows without a score, as zeros."""
    kept: NDArray[np.float32] = (rows * (rows[..., score : score + 1] > 0.0)).astype(np.float32)
    return kept


def _by_score(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """Rows by falling last column."""
    order = np.argsort(-rows[..., -1], axis=1, kind="stable")
    return np.take_along_axis(rows, order[..., None], axis=1)
