"""From keys and sticks to controls: pure functions of what is held and of the control before."""

from __future__ import annotations

from collections.abc import Set

from agents.base import Control, make_control

AHEAD, BACK = frozenset({"up", "w"}), frozenset({"down", "s"})
LEFT, RIGHT = frozenset({"left", "a"}), frozenset({"right", "d"})
STOP = frozenset({"space"})
KEYS = "arrows or W A S D drive, space brakes hard"

MOST_THROTTLE = 0.8
THROTTLE_RISE, BRAKE_RISE = 1.6, 2.5  # a second
STEER_OUT, STEER_BACK = 1.2, 3.0  # a second, away from the middle and towards it
FULL_STEER_MPS = 4.0  # below it keys turn the wheel as far as it goes; faster, by so much less
DEAD = 0.08  # of a stick's way: it never comes to rest quite in the middle


def control_of_keys(held: Set[str], before: Control, speed_mps: float, dt_s: float) -> Control:
    """The control after keys were held for a while.

    Pedals and the wheel move at the rate of a foot and hands, since a key knows on and off alone.

    Args:
        held: Names of the keys that are down.
        before: (3,) throttle, steer, brake held until now.
        speed_mps: The ego's.
        dt_s: For how long the keys were held.
    """
    throttle, steer, brake = before.tolist()
    throttle = min(throttle + THROTTLE_RISE * dt_s, MOST_THROTTLE) if held & AHEAD else 0.0
    brake = min(brake + BRAKE_RISE * dt_s, 1.0) if held & BACK else 0.0
    if held & STOP:
        brake = 1.0
    if brake > 0.0:
        throttle = 0.0
    most = min(1.0, FULL_STEER_MPS / max(speed_mps, FULL_STEER_MPS))
    aim = most * (bool(held & RIGHT) - bool(held & LEFT))
    return make_control(throttle, _towards(steer, aim, dt_s), brake)


def control_of_pad(stick: float, right_trigger: float, left_trigger: float) -> Control:
    """The control that a gamepad says.

    Args:
        stick: The left stick, -1 (left) to 1.
        right_trigger: Throttle, 0 to 1.
        left_trigger: Brake, 0 to 1.
    """
    beyond = max(0.0, abs(stick) - DEAD) / (1.0 - DEAD)
    steer = beyond**2 if stick > 0.0 else -(beyond**2)  # fine near the middle
    return make_control(right_trigger, steer, left_trigger)


def _towards(steer: float, aim: float, dt_s: float) -> float:
    """The wheel on its way to where it is aimed, faster on the way back to the middle."""
    back = abs(aim) < abs(steer) or aim * steer < 0.0
    reach = (STEER_BACK if back else STEER_OUT) * dt_s
    return min(max(aim, steer - reach), steer + reach)
