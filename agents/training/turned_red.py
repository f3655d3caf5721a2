"""Moments before a green light, as they would be before a red one.

In drives a light turns red together with much else: others wait too, crossing traffic comes. A
planner can learn to wait from these, and goes when they let it, its own light still red. Here the
light alone differs, and so does what follows: the way ends before the line, as it does for the
expert, who brakes as late as `ExpertConfig.braking_mps2` lets him.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agents.expert.config import ExpertConfig
from agents.training.foreseen import PAST_M
from agents.training.frames import FRAME_S
from agents.training.interest import line_m
from di_envs.numerics.keyed_arrays import keyed_uniforms, stream_of
from di_envs.town.lanes import LightState

_STREAM = stream_of("green lights that are told red")
_BEFORE_M = 3.1  # the ego's middle from a line that it waits at
_AHEAD_M = 40.0  # lines that are looked at
_HARDEST_MPS2 = 5.0  # whoever had to brake harder is let pass
_STEPS = 20  # between two waypoints
_BRAKING_MPS2 = ExpertConfig().braking_mps2
_RED, _GREEN = 3, 5  # columns of a seen signal


def turned_red(
    moments: NDArray[np.void], valid: NDArray[np.bool_], share: float, key: int
) -> NDArray[np.bool_]:
    """Turns the light of some moments red, in place: told, truly seen, and what the expert does.

    Args:
        moments: (B,) of `caching.MOMENT`.
        valid: (B, T) which waypoints are learnt.
        share: Of the moments that it can be done with.
        key: Of all draws.

    Returns:
        (B,) with which it was done.
    """
    lights = moments["traffic_lights"]
    own = np.isfinite(line_m(moments, "traffic_lights")) & (lights[..., 0] > PAST_M)
    ahead_m = np.hypot(lights[..., 0], lights[..., 1]).astype(np.float64)
    ahead_m = np.where(own & (lights[..., 3] == LightState.GREEN), ahead_m, np.inf).min(axis=1)
    room_m = np.maximum(ahead_m - _BEFORE_M, 0.0)
    speed = moments["speed"][:, 0].astype(np.float64)
    can_stop = speed**2 <= 2.0 * _HARDEST_MPS2 * room_m + 0.25
    drawn = keyed_uniforms(key, _STREAM, 0, (len(moments), 1))[:, 0]
    done = (ahead_m < _AHEAD_M) & can_stop & (drawn < share)
    red = done[:, None] & own & (lights[..., 3] == LightState.GREEN)
    lights[..., 3] = np.where(red, LightState.RED, lights[..., 3])
    moments["signals"] = told_red(moments["signals"], done)
    going = moments["valid"] > 0
    stopped = _stopped(moments["waypoints"].astype(np.float64), going, room_m, speed)
    moments["waypoints"] = np.where(done[:, None, None], stopped, moments["waypoints"])
    valid[done] = going[done]
    return done


def told_red(signals: NDArray[np.float16], done: NDArray[np.bool_]) -> NDArray[np.float16]:
    """(B, K, 8) seen signals, red where they were green at the moments that are done."""
    columns = np.arange(signals.shape[2])
    columns[[_RED, _GREEN]] = _GREEN, _RED
    told: NDArray[np.float16] = np.where(done[:, None, None], signals[..., columns], signals)
    return told


def _stopped(
    ways: NDArray[np.float64],
    valid: NDArray[np.bool_],
    room_m: NDArray[np.float64],
    speed: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(B, T, 2) places on the same ways, of who comes to stand at their end.

    Args:
        ways: (B, T, 2) where it went, ego frame [m].
        valid: (B, T).
        room_m: (B,) that is left before it stands; infinite where nothing ends the way.
        speed: (B,) now [m/s].
    """
    begun = np.concatenate([np.zeros_like(ways[:, :1]), np.where(valid[..., None], ways, 0.0)], 1)
    legs = np.where(valid, np.hypot(*np.moveaxis(np.diff(begun, axis=1), 2, 0)), 0.0)  # (B, T)
    gone = np.concatenate([np.zeros_like(legs[:, :1]), legs.cumsum(axis=1)], axis=1)  # (B, T + 1)
    room_m = np.where(np.isfinite(room_m), room_m, 1e6)
    braking = np.maximum(_BRAKING_MPS2, speed**2 / (2.0 * np.maximum(room_m, 0.1)))
    at, places, step_s = np.zeros(len(ways)), np.zeros_like(ways), FRAME_S / _STEPS
    for t in range(ways.shape[1]):
        as_it_went = legs[:, t] / FRAME_S
        for _ in range(_STEPS):
            allowed = np.sqrt(2.0 * braking * np.maximum(room_m - at, 0.0))
            at = at + np.minimum(as_it_went, allowed) * step_s
        places[:, t] = _place(begun, gone, at)
    return places


def _place(
    begun: NDArray[np.float64], gone: NDArray[np.float64], at: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(B, 2) where a way (B, T + 1, 2) is after so many metres; `gone` (B, T + 1) says how many."""
    rows = np.arange(len(at))
    leg = np.clip((gone[:, 1:] < at[:, None]).sum(axis=1), 0, gone.shape[1] - 2)
    length = gone[rows, leg + 1] - gone[rows, leg]
    part = np.clip((at - gone[rows, leg]) / np.maximum(length, 1e-9), 0.0, 1.0)[:, None]
    placed: NDArray[np.float64] = begun[rows, leg] * (1.0 - part) + begun[rows, leg + 1] * part
    return placed
