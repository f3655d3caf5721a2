"""Stop lines: red and yellow lights, and stop signs, as kernels."""

from __future__ import annotations

from agents.expert.config import ExpertNumbers
from agents.expert.path import DrivePath
from agents.expert.progress import Progress
from agents.expert.speed import NO_LIMIT_MPS2, braking_needed, stop_within, time_to
from agents.expert.surroundings import Lights
from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import LightState, SignalKind
from di_envs.world.lights import GREEN_TICKS, YELLOW_TICKS
from di_envs.world.scenarios.lights import NEAR_M
from di_envs.world.scenarios.lights import YELLOW_TICKS as SHORT_YELLOW_TICKS
from di_envs.world.state import TICK_S

TAIL_M = 1.3  # the red-light rule looks 1 m behind the bumper
PAST_LINE_M = 0.8  # with the front this far over a line, one is in the junction
HARD_MPS2 = 5.0  # harder than this one does not brake for a light that is not yet red
LOOK_M = 120.0
QUEUE_S = 8.0  # of green and yellow left, below which a queue ahead is not followed over the line
QUEUE_BRAKING_MPS2 = 4.0  # with which those ahead may stop
NEVER_S = 1e6
LASTING_S = 1000.0  # a light that stays green for longer is held by a scenario, …
HELD_UNTIL_M = NEAR_M  # … until the car is so near
DECISION_M = 1.5  # that the car may go on before that is seen
TAIL_FROM = 0.8  # the rule's tail begins this many half lengths behind the centre
TAIL_MARGIN_M = 0.1
CRAWLING_MPS = 3.0
HOLD_MPS2 = 1.0
STOP_NEAR_M = 1.5  # a stop for a sign counts this near the line, …
STOP_S = 0.95  # … after a second, but for rounding: who looks each half second sees it

_LIGHT, _STOP = int(SignalKind.LIGHT), int(SignalKind.STOP)
_RED = int(LightState.RED)


@kernel
def seconds_to_red(lights: Lights, signal: int) -> float:
    """How long a light that is not red stays so [s]; zero for a red one."""
    if lights.light[signal] == _RED:
        return 0.0
    ticks = lights.phase_ticks[lights.junction[signal]]
    return (GREEN_TICKS + YELLOW_TICKS - ticks) * TICK_S


@kernel
def _green_held_s(left: float, times: Float64, line_ahead_m: float) -> float:
    """How long [s] a green that a scenario holds lasts: a short yellow comes once the car is near.

    Nearer than that and still green, it stays so until the car has left the junction.
    """
    near = line_ahead_m - HELD_UNTIL_M
    if left < LASTING_S or near < -DECISION_M:
        return left
    return time_to(times, near) + SHORT_YELLOW_TICKS * TICK_S


@kernel
def light_acceleration(
    lights: Lights,
    signal: int,
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
        lights: All lights.
        signal: This one.
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
    left = _green_held_s(seconds_to_red(lights, signal), times, line_m - station_m)
    distance = line_m - station_m - half_length
    over = line_m + TAIL_M + half_length  # where the centre is once the tail is over
    if distance < -PAST_LINE_M:
        if time_to(times, over - station_m) + numbers.red_margin_s <= left:
            return NO_LIMIT_MPS2
        return _between_line_and_tail(line_m - station_m, half_length, speed)
    room = queue[0] - numbers.standstill_gap_m - over - half_length
    clear = time_to(times, over - station_m)
    if room < 0.0:
        clear = max(clear, -room / max(queue[1], 0.1))
        if left < QUEUE_S and room + queue[1] * queue[1] / (2.0 * QUEUE_BRAKING_MPS2) < 0.0:
            clear = NEVER_S  # those ahead may stop, with the car's tail still on the line
    if clear + numbers.red_margin_s <= left:
        return NO_LIMIT_MPS2
    hardest = numbers.emergency_mps2 if left == 0.0 else HARD_MPS2
    if braking_needed(distance + 0.5, speed) > hardest:
        return NO_LIMIT_MPS2
    return stop_within(distance - numbers.line_margin_m, speed, numbers)


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
    lights: Lights,
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
                signal = path.line_signal[q]
                allowed = light_acceleration(
                    lights, signal, line, station, half_length, speed, times, queue, numbers
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
