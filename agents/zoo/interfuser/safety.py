"""The safety controller of `interfuser`: what is safe decides how fast, the waypoints where to.

Whoever the map shows is rolled forward; how far the way is free at 0, 0.5 and 1 s bounds the speed.
Source: Shao et al., InterFuser, CoRL 2022, section 3.3. What we changed: the way goes on straight
beyond the last waypoint, or to the target where the plan is to stand, since how far waypoints reach
is a speed, and the speed is what this decides; decisions are 0.1 s apart instead of 0.05; a cell
counts from a presence on that drives kept out of training ask for (docs/zoo.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

SEEN = 0.95  # presence from which a cell's object counts; published: 0.4
BOX_M, ASIDE_M = 1.25, 1.2  # by which boxes are longer at each end, and wider at each side
WAY_M, STEP_M = 20.0, 0.5  # that are looked at
MOST_MPS = 5.0
NEAREST_M = 3.0  # within which somebody on the way stops the car
RED, SIGN, LINE = 0.3, 0.6, 0.5  # probabilities
RED_STEPS, IGNORED_STEPS = 500, 40
STUCK_STEPS, CREEP_STEPS, CREEP = 600, 6, 0.8
STOOD_MPS = 0.06


@dataclass(frozen=True, kw_only=True)
class SafetyMemory:
    """What the rules remember, in decisions.

    Attributes:
        red: That red has been standing before it.
        ignored: That red is still ignored for.
        stood: That it has stood.
        creep: That it still creeps for.
        obeyed: Whether it has stood at the stop sign that it is at.
    """

    red: int = 0
    ignored: int = 0
    stood: int = 0
    creep: int = 0
    obeyed: bool = False


def objects_of(said: NDArray[np.float32], cells: int) -> NDArray[np.float64]:
    """The objects of a density map.

    Args:
        said: (cells², 8) presence as a logit, offset, log size, sine, cosine, speed [10 m/s].
        cells: Along each side, of 1 m.

    Returns:
        (K, 6) x, y [m], yaw, length, width [m], speed [m/s], the surest of neighbours alone.
    """
    presence = 1.0 / (1.0 + np.exp(-said[:, 0].astype(np.float64).clip(-30.0, 30.0)))
    found = list[list[float]]()
    for cell in np.argsort(-presence, kind="stable"):
        if presence[cell] < SEEN:
            break
        values = said[cell].astype(np.float64)
        x = cell // cells + 0.5 + values[1]
        y = cell % cells + 0.5 - 0.5 * cells + values[2]
        if any(math.hypot(x - other[0], y - other[1]) < 1.5 for other in found):
            continue
        length, width = np.exp(values[3:5].clip(-2.0, 3.0))
        found.append([x, y, math.atan2(values[5], values[6]), length, width, 10.0 * values[7]])
    return np.array(found).reshape(-1, 6)


def way_of(waypoints: NDArray[np.float32], target: NDArray[np.float32]) -> NDArray[np.float64]:
    """(S, 2) places on the way, `STEP_M` apart, up to `WAY_M`."""
    points = np.concatenate([np.zeros((1, 2)), waypoints.astype(np.float64)])
    ahead = points[-1] - points[-2]
    if np.hypot(*points[-1]) < 1.0:  # it plans to stand
        points, ahead = points[:1], target[:2].astype(np.float64)
    length = float(np.hypot(*ahead))
    ahead = ahead / length if length > 1e-3 else np.array([1.0, 0.0])
    points = np.concatenate([points, [points[-1] + WAY_M * ahead]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    at = np.arange(STEP_M, WAY_M + 1e-9, STEP_M)
    return np.stack([np.interp(at, along, points[:, n]) for n in (0, 1)], axis=1)


def free_m(way: NDArray[np.float64], objects: NDArray[np.float64], time_s: float) -> float:
    """How far the way is free when everybody has gone on as he goes for so long."""
    if not len(objects):
        return WAY_M
    x, y, yaw, length, width, speed = objects.T
    cos, sin = np.cos(yaw), np.sin(yaw)
    dx = way[:, 0, None] - (x + time_s * speed * cos)  # (S, K)
    dy = way[:, 1, None] - (y + time_s * speed * sin)
    ahead, aside = np.abs(cos * dx + sin * dy), np.abs(cos * dy - sin * dx)
    met = ((ahead < 0.5 * length + BOX_M) & (aside < 0.5 * width + ASIDE_M)).any(axis=1)
    return float(STEP_M * np.argmax(met)) if met.any() else WAY_M


def safe_speed_mps(free: tuple[float, float, float], speed_mps: float) -> float:
    """How fast it may be; 0 where it must brake.

    Args:
        free: How far the way is free now, in 0.5 s and in 1 s [m].
        speed_mps: How fast it is.
    """
    if free[0] < max(NEAREST_M, speed_mps):
        return 0.0
    return max(min(4.0 * free[1] - speed_mps, MOST_MPS, 2.0 * free[2] - 0.5 * speed_mps), 0.0)


def obeying(
    traffic: NDArray[np.float32], speed_mps: float, memory: SafetyMemory
) -> tuple[bool, SafetyMemory]:
    """Whether a light or a sign stops it.

    Args:
        traffic: (3,) probabilities: a line that governs the lane is near, red or yellow, a sign.
        speed_mps: How fast it is.
        memory: Of the rules.
    """
    at_line = traffic[0] > LINE
    red = bool(at_line and traffic[1] > RED)
    sign = bool(at_line and traffic[2] > SIGN)
    obeyed = sign and (memory.obeyed or speed_mps < STOOD_MPS)
    waited = memory.red + 1 if red else 0
    ignored = max(memory.ignored - 1, 0)
    if waited > RED_STEPS:
        waited, ignored = 0, IGNORED_STEPS
    after = replace(memory, red=waited, ignored=ignored, obeyed=obeyed)
    return (red and not ignored) or (sign and not obeyed), after


def creeping(speed_mps: float, memory: SafetyMemory) -> tuple[bool, SafetyMemory]:
    """Whether it must creep on: who has stood for a minute gives a little throttle."""
    stood = memory.stood + 1 if speed_mps < 0.1 else 0
    creep = max(memory.creep - 1, 0)
    if stood > STUCK_STEPS:
        stood, creep = 0, CREEP_STEPS
    return creep > 0, replace(memory, stood=stood, creep=creep)
