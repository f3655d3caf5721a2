# mypy: disallow_untyped_defs=False
"""Stop lines: red and yellow lights, and stop signs, as kernels."""

from __future__ import annotations

from agents.expert_speed import NO_LIMIT_MPS2, braking_needed, stop_within, time_to
from di_envs.kernels import kernel
from di_envs.town.lanes import LightState, SignalKind
from di_envs.world.lights import GREEN_TICKS, YELLOW_TICKS
from di_envs.world.state import TICK_S

TAIL_M = 1.3  # the red-light rule looks 1 m behind the bumper
PAST_LINE_M = 0.8  # with the front this far over a line, one is in the junction
HARD_MPS2 = 5.0  # harder than this one does not brake for a light that is not yet red
LOOK_M = 120.0
STANDING_MPS = 0.05
STOP_NEAR_M = 1.5  # a stop for a sign counts this near the line

_LIGHT, _STOP = int(SignalKind.LIGHT), int(SignalKind.STOP)
_RED = int(LightState.RED)


@kernel
def seconds_to_red(lights, signal):
    """How long a light that is not red stays so; zero for a red one."""
    if lights.light[signal] == _RED:
        return 0.0
    ticks = lights.phase_ticks[lights.junction[signal]]
    return (GREEN_TICKS + YELLOW_TICKS - ticks) * TICK_S


@kernel
def light_holds(lights, signal, line_m, front_m, speed, clear_s, numbers):
    """Whether the car must stop for a light: the tail would not be over the line before red.

    Args:
        line_m: Station of the line. front_m: Station of the car's front.
        clear_s: When the tail would be over the line.
    """
    distance = line_m - front_m
    left = seconds_to_red(lights, signal)
    if distance < -PAST_LINE_M:  # in the junction: go on, unless held there until red
        return left == 0.0 and speed < STANDING_MPS
    if left > 0.0 and clear_s + numbers.red_margin_s <= left:
        return False
    hardest = numbers.emergency_mps2 if left == 0.0 else HARD_MPS2
    return braking_needed(distance + 0.5, speed) <= hardest


@kernel
def line_acceleration(path, progress, lights, speed, half_length, times, queue, numbers):
    """What the stop lines ahead allow.

    Args:
        times: From `forecast`.
        queue: (station of the rear, speed) of the vehicle ahead, which the car cannot overtake.
    """
    best = NO_LIMIT_MPS2
    front = progress.station_m + half_length
    for q in range(progress.line, path.line_m.size):
        line = path.line_m[q]
        if line > front + LOOK_M:
            break
        distance = line - numbers.line_margin_m - front
        if path.line_kind[q] == _LIGHT:
            if numbers.ignore_lights:
                continue
            over = line + TAIL_M + half_length  # where the centre is once the tail is over
            clear = time_to(times, over - progress.station_m)
            ahead = over + half_length - (queue[0] - numbers.standstill_gap_m)
            if ahead > 0.0:
                clear = max(clear, ahead / max(queue[1], 0.1))
            signal = path.line_signal[q]
            if light_holds(lights, signal, line, front, speed, clear, numbers):
                best = min(best, stop_within(distance, speed, numbers))
        elif path.line_kind[q] == _STOP and not (q == progress.line and progress.stopped):
            if line - front > -PAST_LINE_M:
                best = min(best, stop_within(distance, speed, numbers))
    return best


@kernel
def next_line(path, line, tail_m):
    """The first stop line, from `line` on, that the tail is not yet over."""
    while line < path.line_m.size and tail_m - TAIL_M > path.line_m[line]:
        line += 1
    return line


@kernel
def stops_here(path, line, front_m, speed):
    """Whether the car stands at its next line, so that the stop for a sign is made."""
    if line >= path.line_m.size or speed > 0.05:
        return False
    return path.line_m[line] - front_m < STOP_NEAR_M
