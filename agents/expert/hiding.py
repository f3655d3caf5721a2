"""What stands beside the path and may hide somebody who steps out: how fast to pass it, as kernels.

What is taller than the driver's eye and does not move hides who is behind it. `target_speed` counts
with those whom nothing hides that a map or a look ahead could tell.
"""

from __future__ import annotations

import math

from agents.expert.config import ExpertNumbers
from agents.expert.occlusion import EYE_M
from agents.expert.progress import Progress
from agents.expert.sight import BEST, Seen, Sight
from agents.expert.visible import CAR, Visible
from di_envs.numerics.kernels import kernel

STANDS_MPS = 0.5  # nobody steps out from behind what moves faster
HIDDEN_FROM_M = 0.4  # half width from which on something hides a grown person
BODY_M = 0.3  # half width of who steps out
REACTION_S = 0.2  # until a decision and the brake act
BRAKING_MPS2 = 5.0  # with which the car stops for him
SLOWEST_MPS = 4.0  # at which it passes whatever hides somebody: nobody would follow a slower one


@kernel
def passing_speed(gap_m: float, numbers: ExpertNumbers) -> float:
    """The speed [m/s] at which to pass what hides somebody `gap_m` beside the car.

    Whoever runs out from there is before the car after gap / `runner_mps`; if it is to stand by
    then it may be as fast as it can brake away in that time.
    """
    seconds = max(gap_m / numbers.runner_mps - REACTION_S, 0.0)
    return max(BRAKING_MPS2 * seconds, SLOWEST_MPS)


@kernel
def note_hiding_place(
    sight: Sight, visible: Visible, seen: Seen, progress: Progress, numbers: ExpertNumbers
) -> None:
    """Slows down towards something tall that stands beside the path, ahead.

    Args:
        sight: What the car knows so far; changed.
        visible: What is in sight.
        seen: What may hide somebody.
        progress: Where the car is on the path.
        numbers: From `ExpertConfig`.
    """
    row = seen.row
    if visible.speed[row] > STANDS_MPS or visible.height[row] < EYE_M:
        return
    if visible.half_width[row] < HIDDEN_FROM_M:
        return
    cos, sin = abs(math.cos(seen.turn_rad)), abs(math.sin(seen.turn_rad))
    length = visible.half_length[row] * cos + visible.half_width[row] * sin
    width = visible.half_length[row] * sin + visible.half_width[row] * cos
    gap = abs(seen.offset_m) - width - visible.half_width[CAR]
    distance = seen.station_m + length - progress.station_m - visible.half_length[CAR]
    if gap < 0.0 or distance < 0.0:
        return  # on the path, or passed
    speed = visible.speed[CAR]
    if distance + BODY_M + visible.half_length[CAR] < speed * gap / numbers.runner_mps:
        return  # it is past before anybody could be in its way
    allowed = passing_speed(gap, numbers)
    reachable = math.sqrt(allowed * allowed + 2.0 * numbers.braking_mps2 * distance)
    wanted = (reachable - speed) / numbers.dt_s
    sight.number[BEST] = min(sight.number[BEST], max(wanted, -BRAKING_MPS2))
