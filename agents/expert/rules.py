"""Stop lines: red and yellow lights, and stop signs, as kernels."""

from __future__ import annotations

import math

from agents.expert.config import ExpertNumbers
from agents.expert.path import DrivePath
from agents.expert.progress import Progress
from agents.expert.speed import NO_LIMIT_MPS2, braking_needed, stop_within, time_to
from agents.expert.visible import Visible
from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import LightState, SignalKind

TAIL_M = 1.3  # the red-light rule looks 1 m behind the bumper
PAST_LINE_M = 0.8  # with the front this far over a line, one is in the junction
HARD_MPS2 = 7.0  # harder than this one does not brake for a light that is not yet red
YELLOW_S = 2.0  # the shortest yellow, that of scenarios with lights
READY_M, READY_MPS = 24.0, 15.0  # so near a green light so fast, one can still stop or pass it
LOOK_M = 120.0
QUEUE_BRAKING_MPS2 = 4.0  # with which those ahead may stop
NEVER_S = 1e6
TAIL_FROM = 0.8  # the rule's tail begins this many half lengths behind the centre
TAIL_MARGIN_M = 0.1
CRAWLING_MPS = 3.0
HOLD_MPS2 = 1.0
STOP_NEAR_M = 1.5  # a stop for a sign counts this near the line, …
STOP_S = 0.95  # … after a second, but for rounding: who looks each half second sees it

_LIGHT, _STOP = int(SignalKind.LIGHT), int(SignalKind.STOP)
_GREEN, _YELLOW, _RED = (
    int(state) for state in (LightState.GREEN, LightState.YELLOW, LightState.RED)
)


@kernel
def seconds_to_red(colour: int, yellow_s: float) -> float:
    """How long [s] a light that shows a colour is sure to stay so that one may pass it.

    Nobody sees when green ends. Yellow then lasts for `YELLOW_S` at least.

    Args:
        colour: LightState.
        yellow_s: For how long it has been seen yellow.
    """
    if colour == _RED:
        return 0.0
    return max(YELLOW_S - yellow_s, 0.0) if colour == _YELLOW else YELLOW_S


@kernel
def seconds_yellow(
    path: DrivePath, before: int, line: int, yellow_s: float, visible: Visible, dt_s: float
) -> float:
    """For how long the light at stop line `line` has been seen yellow.

    Args:
        path: The route's path.
        before: The next stop line at the last decision.
        line: The next stop line.
        yellow_s: What was known then.
        visible: What is in sight.
        dt_s: Between decisions.
    """
    if line >= path.line_m.size or path.line_kind[line] != _LIGHT:
        return 0.0
    if visible.light[path.line_signal[line]] != _YELLOW:
        return 0.0
    return yellow_s + dt_s if before == line else dt_s


@kernel
def light_acceleration(
    colour: int,
    left: float,
    line_m: float,
    station_m: float,
    half_length: float,
    speed: float,
    times: Float64,
    queue: tuple[float, float],
    numbers: ExpertNumbers,
) -> float:
    """What a traffic light allows: over its line only if the tail will be over it before red.

    Args:
        colour: LightState.
        left: From `seconds_to_red`.
        line_m: Station of the line.
        station_m: Station of the car's centre.
        half_length: The car's [m].
        speed: The car's [m/s].
        times: From `forecast`.
        queue: (station of the rear, speed) of the vehicle ahead, which the car cannot overtake.
        numbers: From `ExpertConfig`.

    Returns:
        Acceleration [m/s2].
    """
    distance = line_m - station_m - half_length
    over = line_m + TAIL_M + half_length  # where the centre is once the tail is over
    if distance < -PAST_LINE_M:
        if colour == _GREEN or time_to(times, over - station_m) + numbers.red_margin_s <= left:
            return NO_LIMIT_MPS2
        return _between_line_and_tail(line_m - station_m, half_length, speed)
    room = queue[0] - numbers.standstill_gap_m - over - half_length
    clear = time_to(times, over - station_m)
    if room < 0.0:
        clear = max(clear, -room / max(queue[1], 0.1))
        if room + queue[1] * queue[1] / (2.0 * QUEUE_BRAKING_MPS2) < 0.0:
            clear = NEVER_S  # those ahead may stop, with the car's tail still on the line
    if clear + numbers.red_margin_s <= left:
        return NO_LIMIT_MPS2
    if colour == _GREEN and clear < NEVER_S:
        return _ready_to_stop(distance, speed, numbers)
    hardest = numbers.emergency_mps2 if left == 0.0 else HARD_MPS2
    if braking_needed(distance + 0.5, speed) > hardest:
        return NO_LIMIT_MPS2
    return stop_within(distance - numbers.line_margin_m, speed, numbers)


@kernel
def _ready_to_stop(distance_m: float, speed: float, numbers: ExpertNumbers) -> float:
    """Comes to a green light no faster than it can stop there, or pass it, if it turns yellow."""
    ahead = max(distance_m - READY_M, 0.0)
    allowed = math.sqrt(READY_MPS * READY_MPS + 2.0 * numbers.corner_braking_mps2 * ahead)
    return (allowed - speed) / numbers.dt_s


@kernel
def _between_line_and_tail(line_ahead_m: float, half_length: float, speed: float) -> float:
    """Over the line with the front but not with the tail, a slow car waits for green there."""
    room = line_ahead_m + TAIL_FROM * half_length - TAIL_MARGIN_M
    if room < 0.0 or speed > CRAWLING_MPS:
        return NO_LIMIT_MPS2
    needed = braking_needed(room, speed)
    return NO_LIMIT_MPS2 if needed > HARD_MPS2 else -max(needed, HOLD_MPS2)


@kernel
def line_acceleration(
    path: DrivePath,
    progress: Progress,
    visible: Visible,
    speed: float,
    half_length: float,
    times: Float64,
    queue: tuple[float, float],
    numbers: ExpertNumbers,
) -> float:
    """The acceleration that the stop lines ahead allow; arguments as of `light_acceleration`."""
    best = NO_LIMIT_MPS2
    station = progress.station_m
    front = station + half_length
    for q in range(progress.line, path.line_m.size):
        line = path.line_m[q]
        if line > front + LOOK_M:
            break
        if path.line_kind[q] == _LIGHT:
            if not numbers.ignore_lights:
                colour = visible.light[path.line_signal[q]]
                left = seconds_to_red(colour, progress.yellow_s if q == progress.line else 0.0)
                allowed = light_acceleration(
                    colour, left, line, station, half_length, speed, times, queue, numbers
                )
                best = min(best, allowed)
        elif path.line_kind[q] == _STOP and not (q == progress.line and progress.stood_s >= STOP_S):
            if not numbers.ignore_signs and line - front > -PAST_LINE_M:
                best = min(best, stop_within(line - numbers.line_margin_m - front, speed, numbers))
    return best


@kernel
def next_line(path: DrivePath, line: int, tail_m: float) -> int:
    """The first stop line, from `line` on, that a tail at station `tail_m` is not yet over."""
    while line < path.line_m.size and tail_m - TAIL_M > path.line_m[line]:
        line += 1
    return line


@kernel
def stands_at(path: DrivePath, line: int, front_m: float, speed: float) -> bool:
    """Whether the car stands at its next line."""
    if line >= path.line_m.size or speed > 0.05:
        return False
    return path.line_m[line] - front_m < STOP_NEAR_M
