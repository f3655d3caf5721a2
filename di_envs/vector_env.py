"""`RouteVectorEnv`: many routes driven at once, as a native Gymnasium vector environment.

The worlds share one town with all its tables, and threads share out the worlds: one call of a
kernel steps many of them, looks at them and works out rewards and the numbers of `info`, and holds
no Python lock, so that threads run side by side in one process (`di_envs/bulk/`). Each world is
that of a `RouteEnv`, so what comes out is bit for bit what single ones give, for any number of
threads. What the rules count in a step, which is rare, is left to these environments.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray
from typing_extensions import Self

from di_envs.bulk.arguments import check_counts, checked_actions, checked_mask, checked_seeds
from di_envs.bulk.infos import Infos, infos_of
from di_envs.bulk.rows import WorldRows, row_of
from di_envs.bulk.threads import Crew, cores
from di_envs.bulk.worlds import Worlds
from di_envs.copying import Copyable
from di_envs.presets import Form
from di_envs.route_env import Info, Observation, RouteEnv, RouteEnvSnapshot

Steps = tuple[
    Observation, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]
]


@dataclass(frozen=True, kw_only=True)
class VectorSnapshot:
    """What `RouteVectorEnv.save_state` returns: everything that a step or a reset depends on."""

    worlds: tuple[RouteEnvSnapshot, ...]
    steps: tuple[int, ...]  # of each world's episode
    ended: tuple[bool, ...]  # whether the next step resets it, or refuses to step it


class RouteVectorEnv(Copyable, VectorEnv[Observation, NDArray[np.float32], NDArray[Any]]):
    """N `RouteEnv`s side by side, by Gymnasium's rules for autoreset, seeds and `info`.

    `gym.make_vec("DriveInsight-Town05Long-v1", num_envs=16)` makes one. Observations, rewards and
    flags come as fresh arrays with a leading axis of N.

    Attributes:
        envs: The environments, which share their town, routes and tables.
        threads: How many threads step them.
    """

    SPACES: ClassVar[tuple[str, ...]] = (
        *("observation_space", "action_space"),
        *("single_observation_space", "single_action_space"),
    )

    def __init__(
        self,
        num_envs: int = 1,
        *,
        threads: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        """Loads the town once, and makes the worlds.

        Args:
            num_envs: How many worlds.
            threads: How many threads step them; None takes one a core, at most one a world. The
                results are the same bits for any number.
            autoreset_mode: `NextStep`: the step after an episode's end resets, whatever its action
                was. `SameStep`: an ending step already returns the next episode's observation, and
                the last one in `info["final_obs"]`. `Disabled`: the caller resets with
                `options={"reset_mask": …}`.
            max_episode_steps: Truncates episodes after so many steps.
            render_mode: None, or `rgb_array`: `render` returns a picture of each world.
            options: See `RouteEnvConfig`.

        Raises:
            ValueError: If a number is not positive, or an option is refused.
        """
        before = frozenset(vars(self))
        threads = min(cores(), num_envs) if threads is None else threads
        steps = 1 if max_episode_steps is None else max_episode_steps
        check_counts(num_envs=num_envs, threads=threads, max_episode_steps=steps)
        if render_mode == "human":
            raise ValueError(
                "Many worlds have no window: use render_mode='rgb_array', or gymnasium.make for "
                "one of them."
            )
        first = RouteEnv(render_mode=render_mode, **options)
        self.envs = (first, *(first.twin() for _ in range(num_envs - 1)))
        self.num_envs = num_envs
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**first.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = first.render_mode
        self.single_observation_space = first.observation_space
        self.single_action_space = first.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._ended: NDArray[np.bool_]
        self._limit = max_episode_steps
        self._crew = Crew(threads)
        self._prepare()
        made_with = {
            **{"num_envs": num_envs, "threads": threads, "autoreset_mode": autoreset_mode},
            **{"max_episode_steps": max_episode_steps, "render_mode": render_mode},
        }
        self._remember({**made_with, **options}, before)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[Observation, Info]:
        """Starts an episode in every world, or in those of a mask.

        Args:
            seed: One for each world; a number stands for `seed, seed + 1, …`; None continues each
                world's own sequence.
            options: `reset_mask`: (N,) bool, the worlds to reset; the others are left as they are,
                and so are their rows of the observation. The rest goes to `RouteEnv.reset`.

        Raises:
            ValueError: If the seeds or the mask have another length, or an option is refused.
        """
        seeds = checked_seeds(seed, self.num_envs)
        left = dict(options or {})
        mask = checked_mask(left.pop("reset_mask", None), self.num_envs)
        begun: dict[int, Info] = {}
        rows = self._looks.fresh()
        self._crew.each(self._beginnings(np.flatnonzero(mask), rows, begun, seeds, left))
        for index in np.flatnonzero(~mask).tolist():
            self._looks.look(rows, index)
        self._looks.add_prompts(rows)
        return self._form.of(rows), infos_of(begun, self.num_envs, self._add_info)

    def step(self, actions: NDArray[np.float32]) -> Steps:
        """Steps every world; those whose episode has ended are reset as `autoreset_mode` says.

        Args:
            actions: (N, 3) throttle, steer, brake of each.

        Raises:
            ValueError: If an action is refused, before any world has moved.
            gymnasium.error.ResetNeeded: If a world that has ended is not reset automatically.
        """
        resets = self._ended & (self.autoreset_mode == AutoresetMode.NEXT_STEP)
        controls = checked_actions(actions, resets)
        self._worlds.ready(controls, resets, self.threads)
        begun: dict[int, Info] = {}
        rows = self._looks.fresh()
        jobs = self._beginnings(np.flatnonzero(resets), rows, begun)
        self._crew.each([*jobs, *[self._worlds.run] * self.threads])
        if self._looks.with_sensors:
            self._crew.each(
                [partial(self._looks.measure, rows, i) for i in np.flatnonzero(~resets).tolist()]
            )
        self._looks.add_prompts(rows)
        rewards, terminated, truncated, infos = self._worlds.outcome()
        self._steps[~resets] += 1
        if self._limit is not None:
            truncated |= ~resets & (self._steps >= self._limit)
        self._ended = terminated | truncated
        batched = self._restart(rows, infos, begun) if self._restarts() else {}
        for index, info in begun.items():
            infos.put(index, info)
        batched |= infos.batched()
        return self._form.of(rows), rewards, terminated, truncated, batched

    def save_state(self) -> VectorSnapshot:
        """A value from which `restore_state` brings everything back. See `di_envs.save`."""
        return VectorSnapshot(
            worlds=tuple(env.save_state() for env in self.envs),
            steps=tuple(self._steps.tolist()),
            ended=tuple(self._ended.tolist()),
        )

    def restore_state(self, snapshot: VectorSnapshot) -> None:
        """Puts back what `save_state` returned, of this environment or of one made like it.

        Raises:
            ValueError: If the snapshot is of another number of worlds, of another town, or of other
                numbers of actors.
        """
        if len(snapshot.worlds) != self.num_envs:
            raise ValueError(
                f"The snapshot is of {len(snapshot.worlds)} worlds, but here are {self.num_envs}; "
                f"make the environment with num_envs={len(snapshot.worlds)}."
            )
        for env, world in zip(self.envs, snapshot.worlds, strict=True):
            env.restore_state(world)
        self._steps[:] = snapshot.steps
        self._ended = np.array(snapshot.ended)

    def twin(self) -> Self:
        """Another environment like this one, not begun; it shares the town, routes and tables."""
        twin = self._shallow()
        twin.envs = tuple(env.twin() for env in self.envs)
        for name in self.SPACES:
            setattr(twin, name, copy.deepcopy(getattr(self, name)))
        twin._crew = Crew(self.threads)
        twin._prepare()
        return twin

    def observe(self) -> Observation:
        """The present observation once more: after `restore`, for instance. Changes nothing."""
        rows = self._looks.fresh()
        self._crew.each([partial(self._looks.look, rows, i) for i in range(self.num_envs)])
        self._looks.add_prompts(rows)
        return self._form.of(rows)

    def render(self) -> tuple[Any, ...]:
        """A frame of each world."""
        return tuple(env.render() for env in self.envs)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Each environment's attribute of that name; methods are called with the arguments."""
        found = [getattr(env, name) for env in self.envs]
        return tuple(value(*args, **kwargs) if callable(value) else value for value in found)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Each environment's attribute of that name."""
        return tuple(getattr(env, name) for env in self.envs)

    def close_extras(self, **_options: Any) -> None:
        """Stops the threads and closes the environments."""
        self._crew.close()
        for env in self.envs:
            env.close()

    @property
    def threads(self) -> int:
        """How many threads step the worlds."""
        return self._crew.threads

    @property
    def _form(self) -> Form:
        """In which observations are shown."""
        return self.envs[0].course.form

    def _prepare(self) -> None:
        """Makes what belongs to these environments alone: none of them has begun."""
        space = self.envs[0].course.seen_space()
        self._looks = WorldRows(space, [env.observer for env in self.envs])
        self._worlds = Worlds(self.envs)
        self._steps = np.zeros(self.num_envs, np.int64)
        self._ended = np.zeros(self.num_envs, bool)

    def _beginnings(
        self,
        indices: NDArray[np.intp],
        rows: Observation,
        begun: dict[int, Info],
        seeds: Sequence[int | None] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> list[Callable[[], None]]:
        """The jobs of resetting some worlds, whose observations go to their rows."""

        def begin(index: int) -> None:
            self._steps[index] = 0
            self._ended[index] = False
            seed = None if seeds is None else seeds[index]
            observation, begun[index] = self.envs[index].begin(seed=seed, options=options)
            self._looks.write(rows, index, observation)

        return [partial(begin, index) for index in indices.tolist()]

    def _restarts(self) -> bool:
        """Whether a step that ends an episode begins the next one, and some have ended."""
        return self.autoreset_mode == AutoresetMode.SAME_STEP and bool(self._ended.any())

    def _restart(self, rows: Observation, infos: Infos, begun: dict[int, Info]) -> Info:
        """Resets the worlds that have ended; returns what they ended with, as Gymnasium has it."""
        batched: Info = {}
        ended = np.flatnonzero(self._ended)
        last = self._form.of({name: array[ended] for name, array in rows.items()})
        for k, index in enumerate(ended.tolist()):
            final = {"final_obs": row_of(last, k), "final_info": infos.row(index)}
            batched = self._add_info(batched, final, index)
        flags = self._ended.copy()
        self._crew.each(self._beginnings(np.flatnonzero(flags), rows, begun))
        self._looks.add_prompts(rows)
        self._ended = flags
        return batched
