"""What the expert sees of others from its path, and what looking round comes to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agents.expert.speed import NO_LIMIT_MPS2
from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel

FAR_M = 1e6


class Sight(NamedTuple):
    """What `look` finds: numbers by their place in `number`."""

    number: Float64  # (7,) see the constants below


class Seen(NamedTuple):
    """Somebody seen from the path, at the place of the path that is beside him."""

    row: int  # of `Visible`
    station_m: float  # of his middle
    offset_m: float  # of his middle, positive to the right of the path
    turn_rad: float  # from the path's direction to his


BEST, LEADER_REAR, LEADER_SPEED, FRONT_OK, REAR_OK, INSIDE_M, ROOM_M = range(7)


@kernel
def blank_sight() -> Sight:
    """Room for what `look` finds; nothing seen yet."""
    number = np.zeros(7)
    number[BEST] = NO_LIMIT_MPS2
    number[LEADER_REAR] = FAR_M
    number[FRONT_OK] = 1.0
    number[REAR_OK] = 1.0
    number[ROOM_M] = FAR_M
    return Sight(number)
