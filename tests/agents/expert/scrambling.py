"""The same world with all exchanged that nobody could see from the ego's car."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.expert.occlusion import THIN_M, Buildings
from agents.expert.visible import RANGE_M, Visible, empty_visible, see
from di_envs.world.state import ActorKind, State
from di_envs.world.world import WorldView

# What the expert may read of the world; of actors only of those in sight
SEEN_OF_ACTORS = {
    *("kind", "x", "y", "z", "yaw", "speed", "half_length", "half_width", "height"),
    *("brake_light", "indicator"),
}


def seen_by_hand(state: State, visible: Visible) -> NDArray[np.bool_]:
    """Which actors are in sight, told by their places."""
    places = set(zip(visible.x[: visible.seen[0]], visible.y[: visible.seen[0]], strict=True))
    return np.array([(x, y) in places for x, y in zip(state.x, state.y, strict=True)])


def scrambled(view: WorldView, buildings: Buildings, random: np.random.Generator) -> WorldView:
    """The same world with all exchanged that is not seen from the ego, who is hidden too."""
    names = [(name, getattr(view.state, name)) for name in State._fields]
    state = State(**{name: array.copy() for name, array in names})
    visible = empty_visible(state.kind.size, state.light.size)
    see(view.state, view.town.lanes, view.town.signals, buildings, view.ego, False, visible)
    hidden = ~seen_by_hand(state, visible)
    for name in State._fields:
        array: NDArray[Any] = getattr(state, name)
        if name in SEEN_OF_ACTORS:
            continue
        if name != "light" and array.ndim:
            array[...] = random.permutation(array)
            array[...] += random.integers(0, 3, array.shape).astype(array.dtype)
        elif name != "light":
            array[...] += 17
    state.speed[hidden] += 3.0
    far = np.hypot(state.x - state.x[view.ego], state.y - state.y[view.ego]) > RANGE_M
    hidden &= far | (state.half_width < THIN_M)  # others may hide somebody else
    state.yaw[hidden & far] += 1.0  # who is turned behind a corner may look out
    state.indicator[hidden] = 1
    state.brake_light[hidden] = 1 - state.brake_light[hidden]
    state.kind[hidden & (random.random(hidden.size) < 0.3)] = ActorKind.ABSENT
    return dataclasses.replace(view, state=state)
