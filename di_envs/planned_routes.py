"""What becomes of a route file in a town: the routes planned, those refused, what is to be known.

A file from elsewhere may hold a route that cannot be planned, one that jumps, a weather or a
scenario that is not known here. None of that stops the other routes, and nothing of it is silent.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from di_envs.sensors.route_weather import says_nothing
from di_envs.town.kept import kept
from di_envs.town.plan import RoutePlan
from di_envs.town.routing.remarks import odd_routes
from di_envs.town.routing.road_graph import RoadGraph, build_road_graph
from di_envs.town.routing.router import RouteError, plan_route
from di_envs.town.routing.routes import RouteSpec
from di_envs.town.routing.scenarios import placed_on_routes, types_left_out, with_scenarios
from di_envs.town.routing.trigger_files import PlacedScenario
from di_envs.town.town import Town

SHOWN = 3  # of the refused routes: those with their reason


@dataclass(frozen=True, kw_only=True)
class PlannedRoutes:
    """The routes of a file in a town.

    Attributes:
        plans: Those that can be driven, in the order of the file.
        refused: Why the others cannot be planned, by their id.
        warnings: What a person should look at, a few lines each.
        notes: What else is to be known of the routes, a line each.
    """

    plans: tuple[RoutePlan, ...]
    refused: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@kept
def plan_routes(
    town: Town,
    specs: Sequence[RouteSpec],
    *,
    file: str,
    max_snap_m: float,
    broken: Mapping[str, str] | None = None,
    placed: Sequence[PlacedScenario] = (),
    own_scenarios: bool = True,
    strict: bool = False,
) -> PlannedRoutes:
    """Plans routes with their weathers and scenarios; refuses those that cannot be, by their id.

    Args:
        town: Where.
        specs: The routes.
        file: What messages call their file.
        max_snap_m: Largest distance of a keypoint from its lane.
        broken: Why other routes of the file cannot even be read, by their id.
        placed: Scenarios of trigger files.
        own_scenarios: Whether routes meet those of their own file, too.
        strict: Refuse all where one cannot be planned.

    Raises:
        RouteError: If none can be planned, or one cannot and that is strict.
    """
    graph, plans = build_road_graph(town), list[RoutePlan]()
    refused = dict(broken or {})
    if strict and refused:
        raise RouteError(next(iter(refused.values())))
    for spec in specs:
        own = placed_on_routes(spec.scenarios) if own_scenarios else ()
        try:
            plans.append(_planned(graph, spec, max_snap_m, (*placed, *own)))
        except RouteError as error:
            if strict or len(specs) + len(refused) == 1:
                raise
            refused[spec.route_id] = str(error)
    if not plans:
        raise RouteError(f"{file}: no route can be planned.\n" + "\n".join(_reasons(refused)))
    driven = [spec for spec in specs if spec.route_id not in refused]
    said = (_refusals(refused, len(plans) + len(refused), file), odd_routes(plans, file))
    return PlannedRoutes(
        plans=tuple(plans),
        refused=refused,
        warnings=tuple(filter(None, said)),
        notes=(*_scenarios(driven, plans, own_scenarios), *_weathers(driven)),
    )


def _planned(
    graph: RoadGraph, spec: RouteSpec, max_snap_m: float, placed: Sequence[PlacedScenario]
) -> RoutePlan:
    """One route with its weathers and the scenarios that it meets."""
    plan = plan_route(
        graph.town, spec.positions, route_id=spec.route_id, graph=graph, max_snap_m=max_snap_m
    )
    return with_scenarios(dataclasses.replace(plan, weathers=spec.weathers), placed)


def _refusals(refused: Mapping[str, str], count: int, file: str) -> str:
    """Which routes of a file are left out, in a few lines."""
    if not refused:
        return ""
    head = f"{file}: {len(refused)} of {count} routes cannot be planned and are left out:"
    return "\n".join([head, *_reasons(refused)])


def _reasons(refused: Mapping[str, str]) -> Iterator[str]:
    yield from list(refused.values())[:SHOWN]
    if len(refused) > SHOWN:
        yield f"and {', '.join(list(refused)[SHOWN:])}"


def _scenarios(
    specs: Sequence[RouteSpec], plans: Sequence[RoutePlan], taken: bool
) -> Iterator[str]:
    """Which of the scenarios in a route file are met, and which are not."""
    count = sum(len(spec.scenarios) for spec in specs)
    if not count:
        return
    if not taken:
        yield f"Scenarios in the route file, left out as --scenarios says otherwise: {count}."
        return
    known = sum(len(placed_on_routes(spec.scenarios)) for spec in specs)
    left_out = sum((types_left_out(spec.scenarios) for spec in specs), Counter[str]())
    met = sum(len(plan.scenarios) for plan in plans)
    yield f"Scenarios in the route file: {count}, of which routes meet {met}."
    if known > met:
        yield f"Not met: {known - met}; their route stays away, turns otherwise, has another there."
    if left_out:
        types = ", ".join(f"{n} {name}" for name, n in sorted(left_out.items()))
        yield f"Left out, as such types are not staged here: {types}."


def _weathers(specs: Sequence[RouteSpec]) -> Iterator[str]:
    """Which weathers in a route file say nothing that is known here."""
    unknown = Counter(
        weather.name for spec in specs for weather in spec.weathers if says_nothing(weather)
    )
    if unknown:
        names = ", ".join(f"'{name}' ({n} times)" for name, n in sorted(unknown.items()))
        yield f"Weathers of the route file that are none of CARLA's, shown as Default: {names}."
