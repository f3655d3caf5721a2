"""`parallel_env`: several egos in one world, each with its own route, observation and score.

A PettingZoo ParallelEnv. The egos meet each other as they meet the traffic, and traffic and walkers
react to each of them. Whoever's route has ended leaves the road, so that nobody waits behind it.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from pettingzoo import ParallelEnv
from typing_extensions import Self

from di_envs.actions.checked import action_space, checked_action
from di_envs.bulk.rows import row_of
from di_envs.config import check_name
from di_envs.copying import Copyable
from di_envs.course import load_course
from di_envs.drawing.screen import Screen, check_render_mode, render_modes
from di_envs.reward import standing_of
from di_envs.routes_apart import RoutesApart
from di_envs.town.plan import RoutePlan
from di_envs.world.state import ActorKind
from di_envs.world.world import Snapshot, World, WorldView

_SEEDS = 2**32  # of episodes that are reset without a seed

Observation = dict[str, Any]
Steps = tuple[
    dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, Any]
]


@dataclass(frozen=True, kw_only=True)
class MultiEgoSnapshot:
    """What `MultiEgoEnv.save_state` returns."""

    world: Snapshot | None  # None before the first reset
    np_random: Mapping[str, Any]


class MultiEgoEnv(Copyable, ParallelEnv[str, Observation, Any]):
    """Several egos, `ego_0`, `ego_1`, …, in one world.

    Observations, rewards, ends and `info` are each ego's own, as `RouteEnv` describes them. An ego
    whose episode has ended is seen by the others in that step's observations, then is gone.

    Attributes:
        config: The options, with the suite's values in place of None.
        plans: The routes that there are to drive.
        world: The world, for whoever may look behind the scenes.
        agents: Names of the egos that are still driving.
    """

    metadata = {  # noqa: RUF012 (PettingZoo's own contract)
        "name": "driveinsight_v0",
        "render_modes": ["human", "rgb_array"],
        "render_fps": 10,
    }
    SPACES: ClassVar[tuple[str, ...]] = ("_observation_spaces", "_action_spaces")

    def __init__(self, egos: int = 2, *, render_mode: str | None = None, **options: Any) -> None:
        """Loads the town and plans the routes.

        Args:
            egos: How many.
            render_mode: As `RouteEnv` takes it; the picture follows the first ego still driving.
            options: See `RouteEnvConfig`.

        Raises:
            ValueError: If an option is refused, or there are fewer routes than egos.
        """
        before = frozenset(vars(self))
        check_render_mode(render_mode)
        if egos < 1:
            raise ValueError(f"egos must be at least 1; got {egos!r}.")
        self._course = course = load_course(options)
        self.config, self.plans = course.config, course.plans
        if len(self.plans) < egos:
            raise ValueError(
                f"{egos} egos need as many routes, but there are {len(self.plans)}: "
                f"{', '.join(course.route_ids)}."
            )
        self.render_mode = render_mode
        self.metadata = {
            **self.metadata,
            "render_modes": render_modes(render_mode),
            "render_fps": round(1.0 / self.config.control_dt_s),
        }
        self._screen = None if render_mode is None else Screen(course, render_mode)
        self.world = World(course.town, course.world_config)
        self.possible_agents = [f"ego_{ego}" for ego in range(egos)]
        self._routes = RoutesApart(self._course, egos)
        self._egos = {name: ego for ego, name in enumerate(self.possible_agents)}
        self.agents: list[str] = []
        space = course.form.space
        self._observation_spaces = {name: copy.deepcopy(space) for name in self.possible_agents}
        self._action_spaces = {name: action_space() for name in self.possible_agents}
        first = course.observer()
        self._observers = [first.of_ego(ego) for ego in range(egos)]
        self._np_random, _ = seeding.np_random(None)
        self._remember({"egos": egos, "render_mode": render_mode, **options}, before)

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of one ego's observations; always the same object."""
        return self._observation_spaces[self._known(agent)]

    def action_space(self, agent: str) -> spaces.Box:
        """The space of one ego's actions; always the same object."""
        return self._action_spaces[self._known(agent)]

    @property
    def view(self) -> WorldView:
        """The present state, read-only. RuntimeError before a reset."""
        return self.world.view

    def view_of(self, agent: str) -> WorldView:
        """The present state as a privileged agent takes it that drives this ego."""
        ego = self._egos[self._known(agent)]
        return dataclasses.replace(self.view, ego=ego)

    def plan_of(self, agent: str) -> RoutePlan:
        """The route of an ego in this episode. RuntimeError before a reset."""
        return self.view.plans[self._egos[self._known(agent)]]

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, Any]]:
        """Starts an episode with all egos.

        Args:
            seed: Of the world and of the choice of routes; None continues the sequence that the
                last seed began.
            options: `routes`: a route's id or index for each ego, starts at least 12 m
                apart; without it the seed draws them so. Other options pass unread, as PettingZoo's
                conformance test asks.

        Raises:
            ValueError: If routes are unknown, too few, or start too near each other.
        """
        if seed is not None:
            self._np_random, _ = seeding.np_random(seed)
        world_seed = int(self._np_random.integers(_SEEDS)) if seed is None else int(seed)
        routes = (options or {}).get("routes")
        chosen = self._routes.drawn(world_seed) if routes is None else self._routes.given(routes)
        self.world.reset(world_seed, [self.plans[index] for index in chosen])
        self._start()
        view, infos = self.view, {}
        for ego, name in enumerate(self.agents):
            standing = standing_of(view.state, ego)
            infos[name] = self._course.info(view, ego, standing, standing, ())
        observations = self._observe()
        if self.render_mode == "human":
            self._draw(self.agents[0], observations)
        return self._shown(observations), infos

    def step(self, actions: Mapping[str, Any]) -> Steps:
        """Holds each ego's action for `control_dt_s`.

        Args:
            actions: One for each of `agents`: (3,) throttle, steer, brake.

        Raises:
            ValueError: If an ego's action is missing or refused, or there is one for nobody.
            gymnasium.error.ResetNeeded: If no ego is driving.
        """
        if not self.agents:
            raise gymnasium.error.ResetNeeded("No ego is driving any more. Call reset() first.")
        controls = self._controls(actions)
        view, driving = self.view, self._driving()
        before = {ego: standing_of(view.state, ego) for ego in driving.values()}
        events = self.world.advance(controls, self.config.control_ticks)
        rewards, terminated, truncated = {}, {}, {}
        infos: dict[str, Any] = {}
        for name, ego in driving.items():
            after = standing_of(view.state, ego)
            own = tuple(event for event in events if event.ego == ego)
            terminated[name], truncated[name] = self._course.ending(view, ego, before[ego], after)
            infos[name] = self._course.info(view, ego, before[ego], after, own)
            rewards[name] = sum(infos[name]["reward_terms"].values())
        observations = self._observe()
        if self.render_mode == "human":
            self._draw(self.agents[0], observations)
        for name, ego in driving.items():
            if terminated[name] or truncated[name]:
                self.world.remove_actor(ego)
                self.agents.remove(name)
        return self._shown(observations), rewards, terminated, truncated, infos

    def render(self, agent: str | None = None) -> Any:
        """A picture (H, W, 3) uint8 around an ego; None unless the mode is `rgb_array`.

        Args:
            agent: Whom it follows; the first that is still driving, or the first of all.
        """
        followed = self._known(agent or (self.agents or self.possible_agents)[0])
        if self.render_mode != "rgb_array":
            return None
        return self._draw(followed, {})

    def close(self) -> None:
        """Closes the window, if there is one."""
        if self._screen is not None:
            self._screen.close()

    def save_state(self) -> MultiEgoSnapshot:
        """A value from which `restore_state` brings everything back. See `di_envs.save`."""
        return MultiEgoSnapshot(
            world=self.world.save() if self.agents else None,
            np_random=self._np_random.bit_generator.state,
        )

    def restore_state(self, snapshot: MultiEgoSnapshot) -> None:
        """Puts back what `save_state` returned, of this environment or of one made like it."""
        self._np_random.bit_generator.state = dict(snapshot.np_random)
        self.agents = []
        if snapshot.world is not None:
            self.world.restore(snapshot.world)
            self._start()

    def twin(self) -> Self:
        """Another environment like this one, not begun; it shares the town, routes and tables."""
        twin = self._shallow()
        twin.world = self.world.twin()
        twin.agents, twin.possible_agents = [], list(self.possible_agents)
        for name in self.SPACES:
            setattr(twin, name, copy.deepcopy(getattr(self, name)))
        twin._observers = [self._observers[0].of_ego(ego) for ego in range(len(self._observers))]
        twin._np_random, _ = seeding.np_random(None)
        return twin

    def _draw(self, agent: str, observations: Mapping[str, Observation]) -> Any:
        assert self._screen is not None
        ego = self._egos[agent]
        seen = observations.get(agent) or self._observers[ego].front()
        return self._screen.draw(self.view, ego, seen)

    def _start(self) -> None:
        """Takes up the world's episode: those egos drive that are on the road."""
        view = self.view
        for observer in self._observers:
            observer.start(view)
        here = view.state.kind[: len(self.possible_agents)] != ActorKind.ABSENT
        self.agents = [
            name for name, there in zip(self.possible_agents, here, strict=True) if there
        ]

    def _shown(self, observations: Mapping[str, Observation]) -> dict[str, Any]:
        """What egos see in the form that was asked for, made for all of them together."""
        form, seen = self._course.form, list(observations.values())
        if form.preset is None or not seen:
            return dict(observations)
        together = {name: np.stack([own[name] for own in seen]) for name in seen[0]}
        shown = form.of(together)
        return {name: row_of(shown, k) for k, name in enumerate(observations)}

    def _observe(self) -> dict[str, Observation]:
        return {name: self._observers[ego].observe() for name, ego in self._driving().items()}

    def _driving(self) -> dict[str, int]:
        return {name: self._egos[name] for name in self.agents}

    def _known(self, agent: str) -> str:
        check_name(agent, self.possible_agents, "agent")
        return agent

    def _controls(self, actions: Mapping[str, Any]) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Controls (E, 3) of all egos; those who have left hold zeros."""
        if set(actions) != set(self.agents):
            raise ValueError(
                f"step takes an action for each of {', '.join(self.agents)}; got "
                f"{', '.join(map(str, actions)) or 'none'}."
            )
        controls = np.zeros((len(self.possible_agents), 3))
        for name, ego in self._driving().items():
            controls[ego] = checked_action(actions[name])
        return controls


def parallel_env(egos: int = 2, *, render_mode: str | None = None, **options: Any) -> MultiEgoEnv:
    """Makes a PettingZoo ParallelEnv: `di_envs.parallel_env(egos=3, suite="town05_long")`.

    Args:
        egos: How many.
        render_mode: As `RouteEnv` takes it.
        options: See `RouteEnvConfig`.
    """
    return MultiEgoEnv(egos, render_mode=render_mode, **options)
