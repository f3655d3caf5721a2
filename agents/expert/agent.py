"""The agent `expert`: rules over the true state of the world, the reference that others are put to.

It follows its route's lanes on a smooth path, changes lanes where the route does and a gap is free,
keeps gaps, stops at red lights and stop signs, enters junctions only when nobody crosses and
the exit has room, and stops for walkers. It sees everything (track PRIVILEGED) and hides nothing:
its memory is a value.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from agents.base import Control, Observation, Requirements, WorldView
from agents.expert.config import ExpertConfig
from agents.expert.decision import decide, start_progress
from agents.expert.path import DrivePath, build_path
from agents.expert.progress import Progress
from agents.expert.surroundings import actors_of, lights_of, ways_of
from di_envs.town.plan import RoutePlan
from di_envs.world.dynamics import EgoModel


@dataclass(frozen=True, kw_only=True)
class ExpertMemory:
    """The route, the path made of it at the first decision, and the progress along it."""

    plan: RoutePlan
    path: DrivePath | None = None
    progress: Progress | None = None


class Expert:
    """A careful and brisk driver with full knowledge.

    Args:
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
        self._numbers = self.config.numbers()
        self._model = (model or EgoModel()).parameters()

    def start(self, plan: RoutePlan, seed: int) -> ExpertMemory:
        """Remembers the plan; the path is made once the town is seen."""
        return ExpertMemory(plan=plan)

    def act(self, observation: Observation, memory: ExpertMemory) -> tuple[Control, ExpertMemory]:
        """One decision. `observation["world"]` is the read-only view of the world."""
        view: WorldView = observation["world"]
        path, progress = memory.path, memory.progress
        if path is None or progress is None:
            path = build_path(memory.plan, view.town, self.config)
            progress = start_progress()
        throttle, steer, brake, progress = decide(
            path,
            progress,
            actors_of(view.state),
            ways_of(view.town.lanes),
            lights_of(view.state, view.town.signals),
            view.ego,
            self._numbers,
            self._model,
        )
        control = np.array([throttle, steer, brake], dtype=np.float32)
        return control, ExpertMemory(plan=memory.plan, path=path, progress=progress)

    def close(self) -> None:
        """There is nothing to free."""
