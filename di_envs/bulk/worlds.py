"""Many worlds as one kernel takes them, and what comes of a step of all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import NDArray

from di_envs.bulk.infos import Infos
from di_envs.bulk.stepping import (
    Tally,
    WorldParts,
    make_tally,
    step_worlds,
)
from di_envs.numerics.bundle_rows import BundleRow
from di_envs.numerics.kernels import bind
from di_envs.numerics.machine_code import MachineCode
from di_envs.observer import ObservationParts, fill_observation
from di_envs.reward import standing_of, term_names
from di_envs.route_env import RouteEnv
from di_envs.world.building import capacity_for, make_scratch
from di_envs.world.events.rows import COLUMNS, ROWS_PER_EGO
from di_envs.world.step import Scratch, advance
from di_envs.world.world import event_of_row

BLOCK = 2  # worlds that a thread takes at a time


class Outcome(NamedTuple):
    """What a step of many worlds comes to, beside what they see."""

    rewards: NDArray[np.float64]  # (N,)
    terminated: NDArray[np.bool_]  # (N,)
    truncated: NDArray[np.bool_]  # (N,)
    infos: Infos


class Worlds:
    """The worlds of environments that are twins, ready to be stepped together.

    Keeps nothing that a step depends on: what it remembers of events is compared with the worlds.
    """

    def __init__(self, envs: Sequence[RouteEnv]) -> None:
        """Takes the environments, not yet begun; nothing is compiled before the first step."""
        self._envs = envs
        course = envs[0].course
        self._terms = term_names(course.penalties)
        self._ticks = course.config.control_ticks
        self._tally: Tally = make_tally(len(envs), len(self._terms))
        self._sights: list[ObservationParts | None] = [None] * len(envs)
        self._row: BundleRow[WorldParts] | None = None
        self._scratches: list[Scratch] = []
        self._block = 1
        self._route_id = np.full(len(envs), "", object)
        self._world_seed = np.zeros(len(envs), np.int64)
        self._codes: tuple[MachineCode, MachineCode]
        self._kernel: Any = None

    def ready(self, controls: NDArray[np.float64], left: NDArray[np.bool_], threads: int) -> None:
        """Prepares a step of all worlds but those that are left as they are.

        Args:
            controls: (N, 3) throttle, steer, brake, checked.
            left: (N,) the worlds that are left.
            threads: How many will call `run`.

        Raises:
            gymnasium.error.ResetNeeded: If another one has no episode to step.
        """
        for index, (env, is_left) in enumerate(zip(self._envs, left.tolist(), strict=True)):
            if is_left:
                continue
            if env.over:
                raise gymnasium.error.ResetNeeded(
                    f"World {index} has no episode to step: it is over, or none was begun. "
                    "Call reset() first."
                )
            if env.observer.sight is not self._sights[index]:
                self._take(index)
        self._tally.left[:] = left
        self._tally.controls[:] = controls
        self._tally.block[0] = 0
        self._block = min(BLOCK, -(-len(self._envs) // threads))
        if not left.all():
            self._bind(threads)

    def run(self) -> None:
        """Steps worlds and writes their tables, without Python's lock, until none is left to step.

        Any number of threads, up to what `ready` was told, may call it at once.
        """
        if self._tally.left.all():
            return
        scratch = self._scratches.pop()
        observer = self._envs[0].observer
        try:
            self._kernel(
                *self._codes, self._row, scratch, self._tally, self._block, self._ticks,
                observer.with_prompt, observer.with_inertial,
            )  # fmt: skip
        finally:
            self._scratches.append(scratch)

    def outcome(self) -> Outcome:
        """What the step has come to, once all shares are run."""
        tally = self._tally
        stepped = tally.left == 0
        rewards = np.where(stepped, tally.reward, 0.0)
        ended = np.zeros((2, stepped.size), bool)
        infos = Infos(
            self._terms, tally.numbers.copy(), self._route_id.copy(), self._world_seed.copy()
        )
        for index in np.flatnonzero(stepped & (tally.counted != 0)).tolist():
            reward, ended[0, index], ended[1, index], info = self._counted(index)
            rewards[index] = reward
            infos.put(index, info)
        return Outcome(rewards, ended[0], ended[1], infos)

    def _take(self, index: int) -> None:
        """Takes up a world that has begun an episode, or was put to another moment."""
        env, tally = self._envs[index], self._tally
        state, scenery = env.world.moving_parts
        capacity, plan = env.view.capacity, env.plan
        parts = WorldParts(
            state=state,
            scenery=scenery,
            sight=env.observer.sight,
            vehicle_end=capacity.vehicle_end,
            walker_end=capacity.walker_end,
            length_m=plan.length_m,
            junction_m=env.course.junction_m[plan.route_id],
            event_rows=np.zeros((ROWS_PER_EGO * self._ticks, COLUMNS)),
        )
        if self._row is None:
            self._row = BundleRow([parts] * len(self._envs))
        self._row[index] = parts
        self._sights[index] = env.observer.sight
        self._route_id[index] = plan.route_id
        self._world_seed[index] = int(state.seed)
        tally.counts[index] = -1

    def _bind(self, threads: int) -> None:
        """Sees to working memory for each thread, and to machine code."""
        while len(self._scratches) < threads:
            self._scratches.append(self._scratch())
        if self._kernel is not None:
            return
        assert self._row is not None
        world, scratch = self._row[0], self._scratches[0]
        self._codes = (
            MachineCode(
                advance, world.state, world.scenery, scratch, 1, 1, self._ticks, world.event_rows
            ),
            MachineCode(fill_observation, world.sight, 0, True, True),
        )
        self._kernel = bind(
            step_worlds, *self._codes, self._row, scratch, self._tally, 1, 1, True, True
        )

    def _scratch(self) -> Scratch:
        """Working memory that suffices for every route."""
        env, config = self._envs[0], self._envs[0].course.world_config
        town = env.course.town
        capacities = [
            capacity_for(town, (plan,), config.vehicles, config.walkers) for plan in env.plans
        ]
        return make_scratch(town, max(capacities, key=lambda capacity: capacity.actors))

    def _counted(self, index: int) -> tuple[float, bool, bool, dict[str, Any]]:
        """A world's step in which the rules may have counted something, as a single one has it."""
        env, tally = self._envs[index], self._tally
        before = standing_of(tally.before, index)
        assert self._row is not None
        rows = self._row[index].event_rows[: tally.events[index]]
        outcome = env.outcome(before, [event_of_row(row) for row in rows])
        state = env.view.state
        tally.counts[index], tally.pace[index] = state.counts[0], state.pace_share[0]
        tally.penalty[index] = outcome[3]["infraction_penalty"]
        return outcome
