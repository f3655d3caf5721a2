"""Forms that an action can take besides throttle, steer and brake: one pedal, or waypoints.

The wrappers of `wrappers.actions` offer them to a policy, and an agent that was trained with one
turns its outputs into controls by the same functions, so that both drive alike to the bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from di_envs.actions.checked import action_space

WAYPOINTS = 8
WAYPOINT_DT_S = 0.5
WAYPOINT_LIMIT_M = 100.0


def pedal_space() -> spaces.Box:
    """Box of (pedal, steer), each -1..1: full brake to full throttle, left to right."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def waypoint_space() -> spaces.Box:
    """Box of (8, 2): x ahead, y right [m] of the ego in 0.5 s, 1 s, … 4 s, in its present frame."""
    return spaces.Box(-WAYPOINT_LIMIT_M, WAYPOINT_LIMIT_M, (WAYPOINTS, 2), np.float32)


def pedal_to_control(actions: Any) -> NDArray[np.float32]:
    """Throttle, steer and brake of one pedal: what is not throttle is brake, never both.

    Args:
        actions: (..., 2) pedal -1..1 (positive is throttle, negative brake), steer -1..1.

    Returns:
        (..., 3) throttle 0..1, steer -1..1, brake 0..1. What is outside its range stays outside,
        and NaN stays NaN: the environment then refuses it by name.

    Raises:
        ValueError: If the last axis is not of two.
    """
    actions = np.asarray(actions, np.float32)
    if actions.shape[-1:] != (2,):
        raise ValueError(f"A pedal action is two numbers: pedal, steer; got {actions.shape}.")
    pedal, steer = actions[..., 0], actions[..., 1]
    zero = np.float32(0.0)
    throttle = np.maximum(pedal, zero)
    return np.stack([throttle, steer, np.maximum(-pedal, zero)], axis=-1)


# By name; what an action space looks like tells the form.
FORMS: dict[str, spaces.Box] = {
    "control": action_space(),
    "pedal": pedal_space(),
    "waypoints": waypoint_space(),
}


def form_of(space: spaces.Space[Any]) -> str:
    """The name of the form whose actions a policy gives, by their shape.

    Raises:
        ValueError: If it is none of them.
    """
    for name, form in FORMS.items():
        if isinstance(space, spaces.Box) and space.shape == form.shape:
            return name
    known = ", ".join(f"{name} {form.shape}" for name, form in FORMS.items())
    raise ValueError(f"No form of action is like {space}; known are Boxes of {known}.")


def rescaled(action: Any, space: spaces.Box, form: str) -> NDArray[np.float32]:
    """An action of `space` stretched to the bounds of a form; the same bits where they agree.

    So a policy that was trained in [-1, 1] through Gymnasium's `RescaleAction` is understood too.
    """
    target = FORMS[form]
    action = np.asarray(action, np.float32)
    if np.array_equal(space.low, target.low) and np.array_equal(space.high, target.high):
        return action
    share = (action.astype(np.float64) - space.low) / (space.high.astype(np.float64) - space.low)
    wide = target.low + share * (target.high.astype(np.float64) - target.low)
    return np.clip(wide, target.low, target.high).astype(np.float32)
