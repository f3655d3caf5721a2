"""What an environment drives: options checked, suite chosen, town and routes loaded, score kept.

Environments of one ego and of several start from the same `Course` and count by it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from di_envs.config import ROUTE_WEATHER, RouteEnvConfig, check_name
from di_envs.observation import observation_space
from di_envs.observer import Observer
from di_envs.planned_routes import PlannedRoutes
from di_envs.presets import Form
from di_envs.reward import (
    Standing,
    infraction_penalty,
    reward_terms,
    score_metres,
)
from di_envs.rules import rules_named
from di_envs.rules.penalties import Penalties
from di_envs.suites import Suite, choose_suite
from di_envs.town.loading import load_town
from di_envs.town.plan import RoutePlan, RouteWeather
from di_envs.town.town import Town
from di_envs.traffic_level import driving_lanes_m
from di_envs.world.event_names import EVENT_KEYS, event_of_key
from di_envs.world.state import TICK_S, EventKind
from di_envs.world.world import Event, WorldConfig, WorldView


@dataclass(frozen=True, kw_only=True)
class Course:
    """A town, its routes, and how driving them is counted. Never changes, so it can be shared.

    Attributes:
        config: The options, with the suite's values in place of None.
        town: The town.
        plans: The routes that there are to drive.
        world_config: How many others there are.
        penalties: What infractions cost.
        stops: Events that end an episode besides those by which the rules do.
        junction_m: Of each route by its id, (R,) how far each of its points is from the next one
            in a junction, along the route; infinite after the last.
        planned: These routes, those of their file that cannot be planned, and what is to be known.
    """

    config: RouteEnvConfig
    town: Town
    plans: tuple[RoutePlan, ...]
    world_config: WorldConfig
    penalties: Penalties
    stops: tuple[EventKind, ...]
    junction_m: Mapping[str, NDArray[np.float64]]
    planned: PlannedRoutes

    @property
    def route_ids(self) -> tuple[str, ...]:
        """Ids of the routes, by index."""
        return tuple(plan.route_id for plan in self.plans)

    def route_index(self, route: Any) -> int:
        """The index of a route given by id (a string) or by index (an integer).

        Raises:
            ValueError: If there is no such route, or it cannot be planned: says why.
        """
        count = len(self.plans)
        if isinstance(route, str):
            if route in self.planned.refused:
                raise ValueError(self.planned.refused[route])
            check_name(route, self.route_ids, "route id")
            return self.route_ids.index(route)
        if isinstance(route, bool) or not isinstance(route, int | np.integer):
            raise ValueError(f"options['route'] is an id (str) or an index (int); got {route!r}.")
        if not 0 <= route < count:
            raise ValueError(
                f"Route index {route} is not in 0..{count - 1}; for the route whose id is {route} "
                f"give the string '{route}'. Ids: {', '.join(self.route_ids)}."
            )
        return int(route)

    @property
    def weather(self) -> str:
        """What cameras see at the start of an episode."""
        return self.config.weather or "ClearNoon"

    @cached_property
    def form(self) -> Form:
        """In which an environment shows what an ego sees."""
        return Form(self.seen_space(), self.config.preset)

    def seen_space(self) -> spaces.Dict:
        """The space of what an ego sees, whatever the form."""
        config = self.config
        return observation_space(
            config.observations,
            config.cameras,
            config.lidar,
            config.radars,
            half_sweeps=config.half_sweeps,
        )

    def observer(self) -> Observer:
        """Looks at a world through the first ego's eyes; `of_ego` makes those of others."""
        config = self.config
        return Observer(
            self.town,
            config.observations,
            cameras=config.cameras,
            lidar=config.lidar,
            half_sweeps=config.half_sweeps,
            weather=self.weather,
            radars=config.radars,
            gnss_origin=config.gnss_origin,
        )

    def ending(
        self, view: WorldView, ego: int, before: Standing, after: Standing
    ) -> tuple[bool, bool]:
        """Whether an ego's episode is terminated, and whether it is truncated."""
        finished = int(view.state.finished[ego])
        stopped = any(after.counts[kind] > before.counts[kind] for kind in self.stops)
        truncated = finished == EventKind.TIMEOUT
        return stopped or (finished != 0 and not truncated), truncated

    def info(
        self,
        view: WorldView,
        ego: int,
        before: Standing,
        after: Standing,
        events: tuple[Event, ...],
    ) -> dict[str, Any]:
        """An ego's `info` of a step between two standings; `RouteEnv` says what is in it."""
        state, plan = view.state, view.plans[ego]
        finished = int(state.finished[ego])
        return {
            "route_id": plan.route_id,
            "world_seed": int(state.seed),
            "route_completion": 100.0 * after.done_m / plan.length_m,
            "infraction_penalty": infraction_penalty(after, self.penalties),
            "driving_score": 100.0 * score_metres(after, self.penalties) / plan.length_m,
            "game_time_s": int(state.tick) * TICK_S,
            "junction_m": float(self.junction_m[plan.route_id][state.route_index[ego]]),
            "reward_terms": reward_terms(before, after, self.penalties),
            "events": events,
            "finished": EVENT_KEYS[EventKind(finished)] if finished else "",
        }


def load_course(options: Mapping[str, Any], *, cached: bool = True) -> Course:
    """Loads the town and plans the routes.

    Args:
        options: See `RouteEnvConfig`.
        cached: Whether the town may be taken from the cache.

    Raises:
        ValueError: If an option is unknown or refused, or no route can be planned.
        FileNotFoundError: If there is no such town.
    """
    config = RouteEnvConfig.from_mapping(options)
    suite = choose_suite(
        config.suite,
        town=config.town,
        routes=config.routes,
        signals=config.signals,
        scenarios=config.scenarios,
    )
    town = load_town(suite.town_path, suite.signals, cached=cached)
    planned = suite.planned(town, config.route_ids, strict=config.strict)
    level = suite.traffic_in(town)
    vehicles = level.vehicles if config.traffic is None else config.traffic
    walkers = level.walkers if config.walkers is None else config.walkers
    plans, weather = planned.plans, config.weather or suite.weather
    if config.weather is None and any(plan.weathers for plan in plans):
        weather, plans = ROUTE_WEATHER, _all_with_weather(plans, suite.weather)
    return Course(
        config=dataclasses.replace(config, traffic=vehicles, walkers=walkers, weather=weather),
        town=town,
        plans=plans,
        world_config=WorldConfig(vehicles=vehicles, walkers=walkers),
        planned=dataclasses.replace(
            planned, plans=plans, notes=(*planned.notes, *_traffic_notes(config, suite, town))
        ),
        penalties=rules_named(config.rules).penalties,
        stops=tuple(event_of_key(name) for name in config.terminate_on),
        junction_m={plan.route_id: junction_distances(town, plan) for plan in plans},
    )


def _all_with_weather(plans: tuple[RoutePlan, ...], name: str) -> tuple[RoutePlan, ...]:
    """The plans, with the weather of a name where their file says none."""
    given = (RouteWeather(name=name),)
    return tuple(
        plan if plan.weathers else dataclasses.replace(plan, weathers=given) for plan in plans
    )


def _traffic_notes(config: RouteEnvConfig, suite: Suite, town: Town) -> tuple[str, ...]:
    """How many others were chosen, where neither the user nor the suite says it."""
    if suite.traffic is not None or None not in (config.traffic, config.walkers):
        return ()
    level = suite.traffic_in(town)
    counts = {"vehicles": config.traffic, "walkers": config.walkers}
    chosen = [f"{getattr(level, name)} {name}" for name, given in counts.items() if given is None]
    lanes_km = driving_lanes_m(town.lanes) / 1000.0
    return (
        f"Traffic by the length of the map's driving lanes, {lanes_km:.1f} km, at the density of "
        f"the shipped Town05: {' and '.join(chosen)}.",
    )


def junction_distances(town: Town, plan: RoutePlan) -> NDArray[np.float64]:
    """(R,) metres along a route from each of its points to the next one in a junction."""
    inside = town.lanes.junction[plan.lane] >= 0
    places = np.append(plan.route_m[inside], np.inf)
    next_one: NDArray[np.int64] = np.cumsum(inside) - inside  # how many such points come before
    return np.asarray(places[next_one] - plan.route_m)
