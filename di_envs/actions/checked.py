"""The action: throttle, steer and brake as in CARLA's VehicleControl; nothing else gets through."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

NAMES = ("throttle", "steer", "brake")
LOW = (0.0, -1.0, 0.0)
HIGH = (1.0, 1.0, 1.0)  # steer: positive is right


def action_space() -> spaces.Box:
    """Box of (throttle 0..1, steer -1..1, brake 0..1)."""
    return spaces.Box(np.array(LOW, np.float32), np.array(HIGH, np.float32), dtype=np.float32)


def checked_action(action: Any) -> NDArray[np.float64]:
    """An action as (3,) float64, if it is one.

    Args:
        action: Three numbers: throttle, steer, brake.

    Raises:
        ValueError: If it is not three finite numbers within the action space, naming the entry.
    """
    try:
        control = np.asarray(action, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"An action is three numbers {NAMES}; got {action!r}.") from error
    if control.shape != (3,):
        raise ValueError(
            f"An action has shape (3,): {', '.join(NAMES)}; got shape {control.shape}."
        )
    for name, value, low, high in zip(NAMES, control.tolist(), LOW, HIGH, strict=True):
        if not low <= value <= high:  # NaN fails this too
            raise ValueError(
                f"Action entry {name} must be in [{low:g}, {high:g}]; got {value}. Clip or fix "
                f"the agent's output."
            )
    return control
