"""What the numbers of an observation are, and what edits call them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from gymnasium import spaces

from di_envs.config import check_name
from di_envs.edits.text import EditError

# Columns of the tables, as `observation_space` lays them out
COLUMNS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "target_point": ("x", "y", "yaw"),
        "routing": ("x", "y", "yaw", "valid"),
        "map": ("x", "y", "kind", "valid"),
        "obstacles": ("x", "y", "yaw", "length", "width", "vx", "vy", "kind", "valid"),
        "traffic_lights": ("x", "y", "yaw", "state", "valid"),
        "stop_signs": ("x", "y", "yaw", "valid"),
        "odometry": ("x", "y", "yaw"),
    }
)
ALL, CAMERAS = "all", "cameras"
SHORT_NAMES: Mapping[str, str] = MappingProxyType({"lights": "traffic_lights"})


def is_camera(space: spaces.Space[Any]) -> bool:
    """Whether an entry is a camera's RGB image."""
    return isinstance(space, spaces.Box) and space.dtype == np.uint8 and len(space.shape) == 3


def has_valid(name: str) -> bool:
    """Whether the last column of a table says which rows there are."""
    return COLUMNS.get(name, ("",))[-1] == "valid"


def column(name: str, of: str) -> int:
    """Where a column of a table stands.

    Raises:
        EditError: If it has none of that name.
    """
    try:
        check_name(name, COLUMNS[of], f"column of {of}")
    except ValueError as error:
        raise EditError(str(error)) from error
    return COLUMNS[of].index(name)


def names_in(space: spaces.Dict, target: str) -> tuple[str, ...]:
    """The entries of an observation that a target names: one, or all of a kind.

    Raises:
        EditError: If what the agent sees has none of that name; suggests the nearest.
    """
    known = tuple(space.spaces)
    if target == ALL:
        return known
    if target == CAMERAS:
        found = tuple(name for name in known if is_camera(space[name]))
        if not found:
            raise EditError(f"the agent sees no cameras; it sees {', '.join(known)}")
        return found
    name = SHORT_NAMES.get(target, target)
    try:
        check_name(name, known, "part of what the agent sees")
    except ValueError as error:
        raise EditError(str(error)) from error
    return (name,)


def beside(worlds: Any, value: Any) -> Any:
    """(...) for (..., *shape): broadcasts what is said of worlds over the entries of each."""
    return np.reshape(worlds, (*np.shape(worlds), *(1,) * (np.ndim(value) - np.ndim(worlds))))
