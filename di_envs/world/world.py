"""A world: a town, a state, and `advance`, the only place where time moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.state import Capacity, EventKind, State


@dataclass(frozen=True, kw_only=True)
class WorldConfig:
    """How many others there are. Egos are given by the plans at reset."""

    vehicles: int = 120
    walkers: int = 60
    props: int = 0


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that the rules count, or that ends a route."""

    kind: EventKind
    ego: int
    tick: int
    x: float
    y: float
    z: float
    other: int = -1  # the other actor, the signal, or -1
    value: float = 0.0  # metres for OUTSIDE_LANES


@dataclass(frozen=True, kw_only=True)
class WorldView:
    """A read-only look at a world, for privileged agents, renderers and tests."""

    town: Town
    state: State  # read-only arrays
    plans: tuple[RoutePlan, ...]
    capacity: Capacity
    ego: int = 0


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """A saved state: refuses to be restored into another town or layout."""

    town_hash: str
    version: str
    capacity: Capacity
    record: NDArray[np.void]
    plans: tuple[RoutePlan, ...]


class World:
    """One world. `view` is stable: it always shows the present state."""

    view: WorldView

    def __init__(self, town: Town, config: WorldConfig) -> None: ...

    def reset(self, seed: int, plans: Sequence[RoutePlan]) -> None:
        """Starts an episode: egos at their routes' starts, traffic and walkers spawned by `seed`."""

    def advance(self, controls: NDArray[np.float64], ticks: int = 1) -> list[Event]:
        """Holds (E, 3) throttle, steer, brake for `ticks` ticks and returns what happened."""

    def save(self) -> Snapshot: ...

    def restore(self, snapshot: Snapshot) -> None: ...
