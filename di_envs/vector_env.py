"""`RouteVectorEnv`: many routes driven at once, as a native Gymnasium vector environment.

The worlds share one town with all its tables, and threads share out the worlds: kernels hold no
Python lock, so they run side by side in one process, without copies between processes. Each world
is a `RouteEnv` of its own, so what comes out is bit for bit what single ones give, for any number
of threads. Threads do what needs no Python, advance worlds and look at them; rewards and `info` are
made for all once they are through, as threads that keep asking for Python's lock gain nothing.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from gymnasium.error import ClosedEnvironmentError
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray
from typing_extensions import Self

from di_envs.actions.checked import HIGH, LOW, checked_action
from di_envs.copying import Copyable
from di_envs.presets import Form
from di_envs.reward import Standing
from di_envs.route_env import Info, Observation, RouteEnv, RouteEnvSnapshot
from di_envs.vector_rows import WorldRows, batched_infos
from di_envs.world.world import Event

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
        threads = min(_cores(), num_envs) if threads is None else threads
        steps = 1 if max_episode_steps is None else max_episode_steps
        for name, value in (
            ("num_envs", num_envs),
            ("threads", threads),
            ("max_episode_steps", steps),
        ):
            if value < 1:
                raise ValueError(f"{name} must be at least 1; got {value!r}.")
        if render_mode == "human":
            raise ValueError(
                "Many worlds have no window: use render_mode='rgb_array', or gymnasium.make for "
                "one of them."
            )
        first = RouteEnv(render_mode=render_mode, **options)
        self.envs = (first, *(first.twin() for _ in range(num_envs - 1)))
        self.num_envs, self.threads = num_envs, threads
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**first.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = first.render_mode
        self.single_observation_space = first.observation_space
        self.single_action_space = first.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._looks = self._rows_of(self.envs)
        self._limit = max_episode_steps
        self._steps = [0] * num_envs
        self._ended = np.zeros(num_envs, bool)
        self._pool: ThreadPoolExecutor | None = None
        self._pool_of = 0
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
        seeds = self._seeds(seed)
        left = dict(options or {})
        mask = self._mask(left.pop("reset_mask", None))
        chosen = np.flatnonzero(mask).tolist()
        infos: list[Info] = [{}] * self.num_envs
        rows = self._looks.fresh()

        def begin(index: int) -> None:
            infos[index] = self._begin(index, seeds[index], left, rows)

        self._each(chosen, begin)
        for index in np.flatnonzero(~mask).tolist():
            self._looks.look(rows, index)
        self._looks.add_prompts(rows)
        return self._form.of(rows), self._infos(infos, chosen)

    def step(self, actions: NDArray[np.float32]) -> Steps:
        """Steps every world; those whose episode has ended are reset as `autoreset_mode` says.

        Args:
            actions: (N, 3) throttle, steer, brake of each.

        Raises:
            ValueError: If an action is refused, before any world has moved.
            gymnasium.error.ResetNeeded: If a world that has ended is not reset automatically.
        """
        next_step = self.autoreset_mode == AutoresetMode.NEXT_STEP
        resets = self._ended if next_step else np.zeros(self.num_envs, bool)
        controls = self._checked(actions, resets)
        stepped = np.flatnonzero(~resets).tolist()
        before = {index: self.envs[index].hold(controls[index]) for index in stepped}
        events: dict[int, list[Event]] = {}
        infos: list[Info] = [{}] * self.num_envs
        rows, ticks = self._looks.fresh(), self.envs[0].config.control_ticks

        def advance(index: int) -> None:
            if resets[index]:
                infos[index] = self._begin(index, None, {}, rows)
            else:
                events[index] = self.envs[index].world.run(ticks)
                self._looks.look(rows, index)

        self._each(range(self.num_envs), advance)
        self._looks.add_prompts(rows)
        rewards = np.zeros(self.num_envs)
        ended = np.zeros((2, self.num_envs), bool)  # terminated, truncated
        for index in stepped:
            outcome = self._outcome(index, before[index], events[index])
            rewards[index], ended[0, index], ended[1, index], infos[index] = outcome
        self._ended = ended[0] | ended[1]
        batched = self._restart(rows, infos) if self._restarts() else {}
        batched |= self._infos(infos, range(self.num_envs))
        return self._form.of(rows), rewards, ended[0], ended[1], batched

    def save_state(self) -> VectorSnapshot:
        """A value from which `restore_state` brings everything back. See `di_envs.save`."""
        return VectorSnapshot(
            worlds=tuple(env.save_state() for env in self.envs),
            steps=tuple(self._steps),
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
        self._steps = list(snapshot.steps)
        self._ended = np.array(snapshot.ended)

    def twin(self) -> Self:
        """Another environment like this one, not begun; it shares the town, routes and tables."""
        twin = self._shallow()
        twin.envs = tuple(env.twin() for env in self.envs)
        for name in self.SPACES:
            setattr(twin, name, copy.deepcopy(getattr(self, name)))
        twin._looks = twin._rows_of(twin.envs)
        twin._steps, twin._ended = [0] * self.num_envs, np.zeros(self.num_envs, bool)
        twin._pool = None
        return twin

    def observe(self) -> Observation:
        """The present observation once more: after `restore`, for instance. Changes nothing."""
        rows = self._looks.fresh()
        self._each(range(self.num_envs), lambda index: self._looks.look(rows, index))
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
        if self._pool is not None and self._pool_of == os.getpid():
            self._pool.shutdown()
        for env in self.envs:
            env.close()

    @property
    def _form(self) -> Form:
        """In which observations are shown."""
        return self.envs[0].form

    @staticmethod
    def _rows_of(envs: Sequence[RouteEnv]) -> WorldRows:
        """What the worlds see, as it is, whatever the form."""
        return WorldRows(envs[0].seen_space, [env.observer for env in envs])

    def _begin(
        self, index: int, seed: int | None, options: Mapping[str, Any], rows: Observation
    ) -> Info:
        """Resets a world; its observation goes to its row."""
        self._steps[index] = 0
        self._ended[index] = False
        observation, info = self.envs[index].begin(seed=seed, options=options)
        self._looks.write(rows, index, observation)
        return info

    def _outcome(
        self, index: int, before: Standing, events: Sequence[Event]
    ) -> tuple[float, bool, bool, Info]:
        reward, terminated, truncated, info = self.envs[index].outcome(before, events)
        self._steps[index] += 1
        truncated = truncated or (self._limit is not None and self._steps[index] >= self._limit)
        return reward, terminated, truncated, info

    def _restarts(self) -> bool:
        """Whether a step that ends an episode begins the next one, and some have ended."""
        return self.autoreset_mode == AutoresetMode.SAME_STEP and bool(self._ended.any())

    def _restart(self, rows: Observation, infos: list[Info]) -> Info:
        """Resets the worlds that have ended; returns what they ended with, as Gymnasium has it."""
        ended = np.flatnonzero(self._ended).tolist()
        batched: Info = {}
        for index in ended:
            last = self._form.of(self._looks.row(rows, index))
            final = {"final_obs": last, "final_info": infos[index]}
            batched = self._add_info(batched, final, index)
        flags = self._ended.copy()

        def begin(index: int) -> None:
            infos[index] = self._begin(index, None, {}, rows)

        self._each(ended, begin)
        self._looks.add_prompts(rows)
        self._ended = flags
        return batched

    def _each(self, indices: Iterable[int], work: Callable[[int], None]) -> None:
        """Does the work for each index, the threads taking the next one as they become free."""
        todo = iter(indices)  # next() on it holds the lock of the interpreter: nobody gets it twice

        def labour() -> None:
            for index in todo:
                work(index)

        pool = self._threads()
        helpers = [] if pool is None else [pool.submit(labour) for _ in range(self.threads - 1)]
        try:
            labour()
        finally:
            errors = [helper.exception() for helper in helpers]
        for error in filter(None, errors):
            raise error

    def _threads(self) -> ThreadPoolExecutor | None:
        """The threads beside the calling one; made anew in a process that was forked.

        A fork takes no threads along, and whoever waits for one there waits for ever.
        """
        if self.closed:
            raise ClosedEnvironmentError("The environment is closed: make another one.")
        if self.threads > 1 and (self._pool is None or self._pool_of != os.getpid()):
            self._pool = ThreadPoolExecutor(self.threads - 1, "worlds")
            self._pool_of = os.getpid()
        return self._pool

    def _seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [int(seed) + index for index in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"There are {self.num_envs} worlds, so as many seeds; got {seed!r}.")
        return seed

    def _mask(self, mask: Any) -> NDArray[np.bool_]:
        if mask is None:
            return np.ones(self.num_envs, bool)
        mask = np.asarray(mask)
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise ValueError(
                f"options['reset_mask'] has a bool for each of the {self.num_envs} worlds, one or "
                f"more of them true; got {mask!r}."
            )
        return mask

    def _checked(self, actions: Any, resets: NDArray[np.bool_]) -> NDArray[np.float64]:
        """The actions of those that will be stepped, all checked before the first one moves."""
        rows = np.asarray(actions)
        if rows.shape != (self.num_envs, 3):
            raise ValueError(
                f"Actions have shape ({self.num_envs}, 3): throttle, steer, brake of each world; "
                f"got shape {rows.shape}."
            )
        rows = np.where(resets[:, None], 0.0, rows)
        controls = rows.astype(np.float64)
        if not ((controls >= LOW) & (controls <= HIGH)).all():
            for row in rows:
                checked_action(row)  # one of them raises, and says which entry is wrong
        return controls

    def _infos(self, infos: Sequence[Info], chosen: Iterable[int]) -> Info:
        """`info` as Gymnasium batches it: arrays, each with a mask of who has the entry."""
        indices = list(chosen)
        if len(indices) == self.num_envs:
            return batched_infos(infos)
        batched: Info = {}
        for index in indices:
            batched = self._add_info(batched, infos[index], index)
        return batched


def _cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
