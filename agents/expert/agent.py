"""The agent `expert`: rules over what is visible from its car, the reference others are put to.

It follows its route's lanes on a smooth path, changes lanes where the route does and a gap is free,
keeps gaps, stops at red lights and stop signs, enters junctions only when nobody crosses and
the exit has room, and stops for walkers. It measures without error whatever it sees (track
PRIVILEGED), but it decides from `Visible` alone. Its memory is a value.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agents.base import Control, Observation, Requirements, WorldView
from agents.expert.config import ExpertConfig
from agents.expert.crossings import Crossings, crossings_of
from agents.expert.decision import decide, start_progress
from agents.expert.occlusion import Buildings, buildings_of
from agents.expert.path import DrivePath, build_path
from agents.expert.progress import Progress
from agents.expert.visible import empty_visible, see
from di_envs.town.plan import RoutePlan
from di_envs.world.dynamics import EgoModel


class Known(NamedTuple):
    """What is known of a route before it is driven."""

    path: DrivePath
    crossings: Crossings
    buildings: Buildings


@dataclass(frozen=True, kw_only=True)
class ExpertMemory:
    """The route, what the map says of it from the first decision on, and the progress along it."""

    plan: RoutePlan
    known: Known | None = None
    progress: Progress | None = None

    @property
    def path(self) -> DrivePath | None:
        """The path made of the route."""
        return self.known.path if self.known else None


class Expert:
    """A careful and brisk driver.

    Args:
        told: Know where somebody will step out, and see through buildings and vehicles.
        ignore_actors: Drive as if nobody else were there.
        ignore_lights: Drive as if there were no traffic lights.
        ignore_signs: Drive as if there were no stop signs.
        config: Everything else; the three flags override its own.
        model: The ego's dynamics, which its controllers invert.
    """

    requires = Requirements(observations=("prompt",), control_dt_s=0.1, privileged=True)

    def __init__(
        self,
        *,
        told: bool = False,
        ignore_actors: bool = False,
        ignore_lights: bool = False,
        ignore_signs: bool = False,
        config: ExpertConfig | None = None,
        model: EgoModel | None = None,
    ) -> None:
        self.config = dataclasses.replace(
            config or ExpertConfig(dt_s=self.requires.control_dt_s),
            ignore_actors=ignore_actors,
            ignore_lights=ignore_lights,
            ignore_signs=ignore_signs,
        )
        self._told = told
        self._numbers = self.config.numbers()
        self._model = (model or EgoModel()).parameters()

    def start(self, plan: RoutePlan, seed: int) -> ExpertMemory:
        """Remembers the plan; the path is made once the town is seen."""
        return ExpertMemory(plan=plan)

    def act(self, observation: Observation, memory: ExpertMemory) -> tuple[Control, ExpertMemory]:
        """One decision. `observation["world"]` is the read-only view of the world."""
        view: WorldView = observation["world"]
        known, progress = memory.known, memory.progress
        if known is None or progress is None:
            known, progress = self._look_at_map(memory.plan, view), start_progress()
        state, town = view.state, view.town
        visible = empty_visible(state.kind.size, state.light.size)
        see(state, town.lanes, town.signals, known.buildings, view.ego, self._told, visible)
        throttle, steer, brake, progress = decide(
            known.path, progress, known.crossings, visible, self._numbers, self._model
        )
        control = np.array([throttle, steer, brake], dtype=np.float32)
        return control, ExpertMemory(plan=memory.plan, known=known, progress=progress)

    def _look_at_map(self, plan: RoutePlan, view: WorldView) -> Known:
        path = build_path(plan, view.town, self.config, self._told)
        return Known(path, crossings_of(path, view.town), buildings_of(view.town))

    def close(self) -> None:
        """There is nothing to free."""
