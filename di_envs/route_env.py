"""`RouteEnv`: one ego drives one route of a suite, as a Gymnasium environment."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import gymnasium
import numpy as np
from typing_extensions import Self

from di_envs.actions.checked import action_space, checked_action
from di_envs.config import WEATHERS, check_name
from di_envs.copying import Copyable
from di_envs.course import Course, load_course
from di_envs.drawing.screen import Screen, check_render_mode, render_modes
from di_envs.numerics.keyed_random import Stream, keyed_hash
from di_envs.observer import Observer
from di_envs.planned_routes import PlannedRoutes
from di_envs.reward import Standing, standing_of
from di_envs.town.plan import RoutePlan
from di_envs.world.world import Event, Snapshot, World, WorldView

Observation = dict[str, Any]
Info = dict[str, Any]

_RESET_OPTIONS = ("route",)
_EGO = 0
_SEEDS = 2**32  # of episodes that are reset without a seed
_SEED_LIMIT = 2**63


@dataclass(frozen=True, kw_only=True)
class RouteEnvSnapshot:
    """What `RouteEnv.save_state` returns: everything that a step or a reset depends on."""

    world: Snapshot | None  # None before the first reset
    over: bool
    weather: str
    np_random: Mapping[str, Any]
    np_random_seed: int


class RouteEnv(Copyable, gymnasium.Env[Observation, np.ndarray[Any, Any]]):
    """Drives one route an episode, among traffic and walkers, by the Leaderboard's rules.

    An episode terminates when the route is completed, when the ego has left it or is blocked, and
    at the events in `terminate_on`; it is truncated by the route's timeout. The reward is the
    growth of the driving score in metres (`di_envs.reward`). `info` holds:

    - `route_id` and `world_seed`, and `route_completion` [percent], `infraction_penalty` (0..1,
      without the metres outside lanes) and `driving_score` (0..100) so far;
    - `game_time_s` since the episode began;
    - `junction_m` along the route to the next junction: 0 in one, infinite after the last;
    - `reward_terms`: the named terms that add up to the reward;
    - `events`: the step's `Event`s, a tuple;
    - `finished`: name of the event that ended the route by the rules, empty while it goes on.

    Attributes:
        config: The options, with the suite's values in place of None.
        world: The world below, for whoever may look behind the scenes.
        plans: The routes that there are to drive, in the order of `route_ids`. Of a file, those
            that can be planned; the others are warned about.
    """

    metadata = {  # noqa: RUF012 (Gymnasium's own contract)
        "render_modes": ["human", "rgb_array"],
        "render_fps": 10,
    }
    SPACES: ClassVar[tuple[str, ...]] = ("observation_space", "action_space")

    def __init__(
        self, *, render_mode: str | None = None, cached: bool = True, **options: Any
    ) -> None:
        """Loads the town and plans the routes.

        Args:
            render_mode: `rgb_array`: `render` returns a picture for people, see
                `di_envs.drawing.view`. `human`: a window shows it after each reset and step. None:
                no pictures.
            cached: Whether the town may be taken from the cache of towns that were read before;
                False reads its map, whatever is there.
            options: See `RouteEnvConfig`.

        Raises:
            ValueError: If an option is unknown or refused, or no route can be planned.
            FileNotFoundError: If there is no such town.
            RuntimeError: If there is no display for `human`.
        """
        before = frozenset(vars(self))
        check_render_mode(render_mode)
        self._course = course = load_course(options, cached=cached)
        self.config, self.plans = course.config, course.plans
        self.world = World(course.town, course.world_config)
        self.observation_space = course.form.space
        self.action_space = action_space()
        self._observer = course.observer()
        self.render_mode = render_mode
        self.metadata = {
            **self.metadata,
            "render_modes": render_modes(render_mode),
            "render_fps": round(1.0 / self.config.control_dt_s),
        }
        self._screen = None if render_mode is None else Screen(course, render_mode)
        self._begun = False
        self._over = True
        self._remember({"render_mode": render_mode, **options}, before)

    @property
    def route_ids(self) -> tuple[str, ...]:
        """Ids of the routes, by index."""
        return self._course.route_ids

    @property
    def planned(self) -> PlannedRoutes:
        """The routes, those of their file that cannot be planned, and what is to be known."""
        return self._course.planned

    @property
    def course(self) -> Course:
        """Town, routes and how driving is counted; shared by twins, and never changed."""
        return self._course

    @property
    def over(self) -> bool:
        """Whether there is no episode to step: it is over, or none was begun."""
        return self._over

    @property
    def view(self) -> WorldView:
        """The present state, read-only, for privileged agents. RuntimeError before a reset."""
        return self.world.view

    @property
    def plan(self) -> RoutePlan:
        """The route being driven. RuntimeError before a reset."""
        return self.view.plans[_EGO]

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, Info]:
        """Starts an episode.

        Args:
            seed: Of the world and of the choice of a route: 0 or more. Equal seeds and routes give
                equal episodes, bit for bit, whatever came before. Without one, the next seed of
                the sequence that the last seed began.
            options: `route`: a route's id (a string) or its index in `route_ids` (an integer);
                without it the seed draws one.

        Raises:
            ValueError: If the seed is too large, or an option or the route is unknown.
        """
        observation, info = self.begin(seed=seed, options=options)
        if self.render_mode == "human":
            self._draw(observation)
        return self._course.form.of(observation), info

    def begin(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, Info]:
        """The first part of a reset: all of it but the form in which the observation is shown."""
        if seed is not None and seed >= _SEED_LIMIT:
            raise ValueError(f"A seed is a whole number from 0 to 2**63 - 1; got {seed}.")
        super().reset(seed=seed)
        world_seed = int(self.np_random.integers(_SEEDS)) if seed is None else int(seed)
        index = self._route_index(dict(options or {}), world_seed)
        self.world.reset(world_seed, [self.plans[index]])
        self._begun, self._over = True, False
        self._observer.weather = self._course.weather
        self._observer.start(self.view)
        standing = standing_of(self.view.state, _EGO)
        info = self._course.info(self.view, _EGO, standing, standing, ())
        return self._observer.observe(), info

    def step(self, action: np.ndarray[Any, Any]) -> tuple[Observation, float, bool, bool, Info]:
        """Holds an action for `control_dt_s`.

        Args:
            action: (3,) throttle 0..1, steer -1..1 (positive is right), brake 0..1.

        Raises:
            ValueError: If the action is not in the action space.
            gymnasium.error.ResetNeeded: Before the first reset, and after an episode's end.
        """
        before = self.hold(checked_action(action))
        events = self.world.run(self.config.control_ticks)
        outcome = self.outcome(before, events)
        observation = self._observer.observe()
        if self.render_mode == "human":
            self._draw(observation)
        return self._course.form.of(observation), *outcome

    def hold(self, control: np.ndarray[Any, Any]) -> Standing:
        """The first part of a step: holds a checked action; `world.run` is the second.

        Returns:
            The standing before the step, for `outcome`.

        Raises:
            gymnasium.error.ResetNeeded: Before the first reset, and after an episode's end.
        """
        if self._over:
            raise gymnasium.error.ResetNeeded(
                "There is no episode to step: it is over, or none was begun. Call reset() first."
            )
        self.world.hold(control[None])
        return standing_of(self.view.state, _EGO)

    def outcome(self, before: Standing, events: Sequence[Event]) -> tuple[float, bool, bool, Info]:
        """The last part of a step but for the look: reward, terminated, truncated, info."""
        view, course = self.view, self._course
        after = standing_of(view.state, _EGO)
        terminated, truncated = course.ending(view, _EGO, before, after)
        self._over = terminated or truncated
        info = course.info(view, _EGO, before, after, tuple(events))
        return sum(info["reward_terms"].values()), terminated, truncated, info

    def render(self) -> Any:
        """A picture of the present state, (H, W, 3) uint8; None unless the mode is `rgb_array`.

        Raises:
            gymnasium.error.ResetNeeded: Before the first reset.
        """
        if not self._begun:
            raise gymnasium.error.ResetNeeded("There is nothing to see yet. Call reset() first.")
        if self.render_mode is None:
            gymnasium.logger.warn("render() does nothing: make it with render_mode='rgb_array'.")
        return self._draw(self._observer.front()) if self.render_mode == "rgb_array" else None

    def picture(self, observation: Observation) -> Any:
        """What `render` returns, with the camera's image taken from the present observation.

        Whoever has just been given one, as when filming, so spares a second look.
        """
        return self._draw(observation if isinstance(observation, Mapping) else {})

    def close(self) -> None:
        """Closes the window, if there is one."""
        if self._screen is not None:
            self._screen.close()

    def observe(self) -> Observation:
        """The present observation once more: after `restore`, for instance. Changes nothing."""
        self.view  # noqa: B018 (raises before the first reset)
        return self._course.form.of(self._observer.observe())

    def change_weather(self, weather: str) -> None:
        """Changes what cameras see, until the next reset.

        Args:
            weather: One of CARLA's presets.

        Raises:
            ValueError: If it is unknown.
            RuntimeError: Before the first reset.
        """
        check_name(weather, WEATHERS, "weather")
        self._observer.weather = weather
        self._observer.start(self.view)

    @property
    def observer(self) -> Observer:
        """Looks at the world through the ego's eyes."""
        return self._observer

    def save_state(self) -> RouteEnvSnapshot:
        """A value from which `restore_state` brings everything back. See `di_envs.save`."""
        return RouteEnvSnapshot(
            world=self.world.save() if self._begun else None,
            over=self._over,
            weather=self._observer.weather,
            np_random=self.np_random.bit_generator.state,
            np_random_seed=self.np_random_seed,
        )

    def restore_state(self, snapshot: RouteEnvSnapshot) -> None:
        """Puts back what `save_state` returned, of this environment or of one made like it.

        Raises:
            ValueError: If the snapshot is of another town or of other numbers of actors.
        """
        self._observer.weather = snapshot.weather
        if snapshot.world is not None:
            self.world.restore(snapshot.world)
            self._observer.start(self.view)
        self._begun, self._over = snapshot.world is not None, snapshot.over
        self.np_random.bit_generator.state = dict(snapshot.np_random)
        self._np_random_seed = snapshot.np_random_seed

    def twin(self) -> Self:
        """Another environment like this one, not begun; it shares the town, routes and tables.

        What is shared never changes, so twins may be stepped in threads of their own.
        """
        twin = self._shallow()
        twin.world = self.world.twin()
        twin.observation_space = copy.deepcopy(self.observation_space)
        twin.action_space = copy.deepcopy(self.action_space)
        twin._observer = self._observer.of_ego(_EGO)
        twin._begun, twin._over = False, True
        twin._np_random, twin._np_random_seed = None, None
        return twin

    def _draw(self, observation: Observation) -> Any:
        """Shows the present state in the window, or returns the picture."""
        assert self._screen is not None
        return self._screen.draw(self.view, _EGO, observation)

    def _route_index(self, options: dict[str, Any], world_seed: int) -> int:
        for option in options:
            check_name(option, _RESET_OPTIONS, "reset option")
        if options.get("route") is None:
            return int(keyed_hash(world_seed, int(Stream.ROUTE), 0, 0)) % len(self.plans)
        return self._course.route_index(options["route"])
