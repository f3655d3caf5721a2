"""Accelerations that keep a speed, a gap or a stop, and a forecast of arrivals, as kernels."""

from __future__ import annotations

import math

from agents.expert.config import ExpertNumbers
from agents.expert.path import DrivePath
from agents.expert.progress import speed_at
from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel

NO_LIMIT_MPS2 = 100.0  # an acceleration that binds nobody
HOLD_MPS2 = -1.0
SLOWEST_MPS = 0.5  # a moving car's least speed in a forecast


@kernel
def cruise(path: DrivePath, station_m: float, speed: float, numbers: ExpertNumbers) -> float:
    """Acceleration [m/s2] towards the path's own speed."""
    target = speed_at(path, station_m + speed * numbers.dt_s)
    wanted = (target - speed) / numbers.dt_s
    return min(max(wanted, -1.5 * numbers.corner_braking_mps2), numbers.acceleration_mps2)


@kernel
def follow(gap_m: float, speed: float, leader_speed: float, numbers: ExpertNumbers) -> float:
    """The Intelligent Driver Model's answer to a leader, without its own cruise.

    Source: Treiber, Hennecke, Helbing: Congested traffic states in empirical observations and
    microscopic simulations, Phys. Rev. E 62, 2000; here with this driver's numbers.

    Args:
        gap_m: From bumper to bumper.
        speed, leader_speed: Along the path [m/s].
        numbers: From `ExpertConfig`.

    Returns:
        Acceleration [m/s2].
    """
    comfort = 2.0 * math.sqrt(numbers.acceleration_mps2 * numbers.braking_mps2)
    dynamic = speed * numbers.time_gap_s + speed * (speed - leader_speed) / comfort
    wanted = numbers.standstill_gap_m + max(dynamic, 0.0)
    ratio = wanted / max(gap_m, 0.1)
    answer = numbers.acceleration_mps2 * (1.0 - ratio * ratio)
    return max(answer, -numbers.emergency_mps2)


@kernel
def braking_needed(distance_m: float, speed: float) -> float:
    """Deceleration [m/s2], positive, that stops within a distance."""
    return speed * speed / (2.0 * max(distance_m, 0.05))


@kernel
def stop_within(distance_m: float, speed: float, numbers: ExpertNumbers) -> float:
    """Acceleration that stops at a point `distance_m` ahead with the planned braking.

    It binds only once the point is as near as the braking distance; harder braking than planned is
    used only where the point came up late.
    """
    if distance_m <= 0.25 and speed < 0.05:
        return HOLD_MPS2
    needed = braking_needed(distance_m, speed)
    if distance_m <= 0.0 or needed > 1.3 * numbers.braking_mps2:
        return -min(needed, numbers.emergency_mps2)
    target = math.sqrt(2.0 * numbers.braking_mps2 * max(distance_m - speed * numbers.dt_s, 0.0))
    return max((target - speed) / numbers.dt_s, -1.3 * numbers.braking_mps2)


@kernel
def forecast(
    path: DrivePath, station_m: float, speed: float, numbers: ExpertNumbers, times: Float64
) -> None:
    """Fills `times` (M,) with when [s] the car is 0, 1, 2, … m on, held by path speeds."""
    now, v = 0.0, speed
    for k in range(times.size):
        times[k] = now
        limit = max(speed_at(path, station_m + k + 1.0), SLOWEST_MPS)
        faster = min(math.sqrt(v * v + 2.0 * numbers.acceleration_mps2), limit)
        now += 2.0 / max(v + faster, SLOWEST_MPS)
        v = faster


@kernel
def time_to(times: Float64, distance_m: float) -> float:
    """When [s] the car has gone a distance, from `forecast` (M,); after its end, at 10 m/s."""
    if distance_m <= 0.0:
        return 0.0
    k = int(distance_m)
    last = times.size - 1
    if k >= last:
        return times[last] + 0.1 * (distance_m - last)
    return times[k] + (distance_m - k) * (times[k + 1] - times[k])


@kernel
def time_over(distance_m: float, speed: float, acceleration: float) -> float:
    """Time [s] to go a distance from a speed, gaining speed evenly."""
    if distance_m <= 0.0:
        return 0.0
    return (math.sqrt(speed * speed + 2.0 * acceleration * distance_m) - speed) / acceleration
