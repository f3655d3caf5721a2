"""How a driver keeps behind another: the Intelligent Driver Model, and what is safe besides.

Source: Intelligent Driver Model (Treiber, Hennecke, Helbing: Congested traffic states in empirical
observations and microscopic simulations, Phys. Rev. E 62, 2000) with highway-env's parameters and
form (`highway_env.vehicle.behavior.IDMVehicle`, Leurent 2018); the speed is capped besides by what
lets one stop behind a leader that brakes as hard as it can (Gipps: A behavioural car-following
model for computer simulation, Transportation Research B 15, 1981).
"""

from __future__ import annotations

import math

from di_envs.numerics.kernels import kernel
from di_envs.world.state import TICK_S

# highway-env's IDM parameters; distances there are between the middles of 5 m cars
ACCELERATION_MPS2 = 3.0
COMFORT_BRAKING_MPS2 = 5.0
DISTANCE_WANTED_M = 10.0
CAR_LENGTH_M = 5.0
TIME_WANTED_S = 1.5
MAX_BRAKING_MPS2 = 6.0
EMERGENCY_BRAKING_MPS2 = 8.0  # also what an ego can do

NO_LEADER_M = 1e9  # the gap on a free road


@kernel
def idm_acceleration(
    speed: float, desired_speed: float, gap_m: float, leader_speed: float
) -> float:
    """The Intelligent Driver Model's acceleration, as highway-env has it.

    Args:
        speed: Own speed [m/s].
        desired_speed: Speed wanted on a free road [m/s], positive.
        gap_m: Free distance to the leader, bumper to bumper; NO_LEADER_M for none.
        leader_speed: Its speed along the lane [m/s].

    Returns:
        Acceleration [m/s2], not clipped.
    """
    ratio = max(speed, 0.0) / desired_speed
    free = 1.0 - ratio * ratio * ratio * ratio
    if gap_m >= NO_LEADER_M:
        return ACCELERATION_MPS2 * free
    wanted = (
        DISTANCE_WANTED_M
        + speed * TIME_WANTED_S
        + speed
        * (speed - leader_speed)
        / (2.0 * math.sqrt(ACCELERATION_MPS2 * COMFORT_BRAKING_MPS2))
    )
    share = max(wanted, 0.0) / max(gap_m + CAR_LENGTH_M, 0.1)
    return ACCELERATION_MPS2 * (free - share * share)


@kernel
def safe_speed(
    gap_m: float, leader_speed: float, braking_mps2: float, leader_braking_mps2: float
) -> float:
    """The highest speed for the next tick from which one can stop behind the leader.

    It holds for a leader that brakes at `leader_braking_mps2` from now on, and for oneself braking
    at `braking_mps2` from the next tick on.
    """
    room = max(gap_m, 0.0) + leader_speed * leader_speed / (2.0 * leader_braking_mps2)
    step = braking_mps2 * TICK_S
    return max(-step + math.sqrt(step * step + 2.0 * braking_mps2 * room), 0.0)
