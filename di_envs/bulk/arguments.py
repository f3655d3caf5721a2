"""What a vector environment is asked to do, checked before any world moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.actions.checked import HIGH, LOW, checked_action


def checked_seeds(seed: int | Sequence[int | None] | None, worlds: int) -> Sequence[int | None]:
    """A seed for each world: a number stands for itself and those after it.

    Raises:
        ValueError: If there are not as many as worlds.
    """
    if seed is None:
        return [None] * worlds
    if isinstance(seed, int | np.integer):
        return [int(seed) + index for index in range(worlds)]
    if len(seed) != worlds:
        raise ValueError(f"There are {worlds} worlds, so as many seeds; got {seed!r}.")
    return seed


def checked_mask(mask: Any, worlds: int) -> NDArray[np.bool_]:
    """(N,) which worlds are reset; None stands for all.

    Raises:
        ValueError: If it is no mask of the worlds, or leaves out all of them.
    """
    if mask is None:
        return np.ones(worlds, bool)
    mask = np.asarray(mask)
    if mask.shape != (worlds,) or mask.dtype != np.bool_ or not mask.any():
        raise ValueError(
            f"options['reset_mask'] has a bool for each of the {worlds} worlds, one or more of "
            f"them true; got {mask!r}."
        )
    return mask


def checked_actions(actions: Any, resets: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(N, 3) the actions of those that will be stepped; zeros for those that `resets` says.

    Raises:
        ValueError: If one is refused.
    """
    rows = np.asarray(actions)
    if rows.shape != (resets.size, 3):
        raise ValueError(
            f"Actions have shape ({resets.size}, 3): throttle, steer, brake of each world; "
            f"got shape {rows.shape}."
        )
    if resets.any():
        rows = np.where(resets[:, None], 0.0, rows)
    controls = rows.astype(np.float64)
    if not ((controls >= LOW) & (controls <= HIGH)).all():
        for row in rows:
            checked_action(row)  # one of them raises, and says which entry is wrong
    return controls


def check_counts(**counts: int) -> None:
    """Raises ValueError for one that is not positive."""
    for name, value in counts.items():
        if value < 1:
            raise ValueError(f"{name} must be at least 1; got {value!r}.")
