"""Which scenarios a route meets: triggers matched to its dense points as the Leaderboard does.

A trigger belongs to a route that passes within 2 m and 10 degrees of it, counted in three
dimensions, so one on a bridge is not met below it. Of several at one place the one with the
highest number is taken. Scenarios 4, 7, 8 and 9 need a turn: the route's next one decides which
variant it is, and whether there is any. A scenario begins once the ego is within 1.5 m of its
trigger, along the route; a trigger that no route point comes so near to never begins.

Source: behaviour of `leaderboard/utils/route_parser.py`, `leaderboard/scenarios/route_scenario.py`
(CARLA Leaderboard 1.0, MIT licence) and of `ScenarioTriggerer` (CARLA ScenarioRunner, MIT licence);
our own code. Unlike theirs, the point is sought from the matched one on, and so never on an earlier
crossing of the same place. Of several at one place theirs falls back to a
random one where the highest is too near to one chosen before, ours to the next lower number.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.town.plan import RoadOption, RoutePlan, ScenarioTrigger
from di_envs.town.routing.routes import RouteScenario
from di_envs.town.routing.trigger_files import PlacedScenario

MATCH_M = 2.0
MATCH_RAD = math.radians(10.0)
START_M = 1.5  # from the trigger to the route point nearest to the ego
STAGED = (1, 3, 4, 7, 8, 9, 10)  # 2, 5 and 6 are in no file of the Town05 benchmark

# The numbers of what Leaderboard 2.x calls by names, in its route files
NUMBER_OF_TYPE = {
    "ControlLoss": 1,
    "DynamicObjectCrossing": 3,
    "VehicleTurningRoute": 4,
    "VehicleTurningRoutePedestrian": 4,
    "OppositeVehicleRunningRedLight": 7,
    "SignalizedJunctionLeftTurn": 8,
    "SignalizedJunctionRightTurn": 9,
    "NonSignalizedJunctionLeftTurn": 10,
    "NonSignalizedJunctionLeftTurnEnterFlow": 10,
    "NonSignalizedJunctionRightTurn": 10,
}

# The variants by the command at the next turn; numbers that are not here have one only.
SUBTYPES = {
    4: {RoadOption.LEFT: "S4left", RoadOption.RIGHT: "S4right"},
    7: {
        RoadOption.LEFT: "S7left",
        RoadOption.RIGHT: "S7right",
        RoadOption.STRAIGHT: "S7opposite",
    },
    8: {RoadOption.LEFT: "S8left"},
    9: {RoadOption.RIGHT: "S9right"},
}

_NOT_TURNS = (RoadOption.LANEFOLLOW, RoadOption.CHANGELANELEFT, RoadOption.CHANGELANERIGHT)


def placed_on_routes(scenarios: Iterable[RouteScenario]) -> tuple[PlacedScenario, ...]:
    """Those scenarios of a 2.x route file that are of types that there are here."""
    return tuple(
        PlacedScenario(NUMBER_OF_TYPE[s.type], s.x, s.y, s.z, math.radians(s.yaw_deg))
        for s in scenarios
        if s.type in NUMBER_OF_TYPE
    )


def types_left_out(scenarios: Iterable[RouteScenario]) -> Counter[str]:
    """How many there are of each type that there is not."""
    return Counter(s.type for s in scenarios if s.type not in NUMBER_OF_TYPE)


class _Candidate(NamedTuple):
    """A trigger that the route passes and that fits its turns."""

    place: PlacedScenario
    subtype: str
    point: int  # first route point that matches


def with_scenarios(plan: RoutePlan, placed: Sequence[PlacedScenario]) -> RoutePlan:
    """The plan with the scenarios that it meets."""
    return dataclasses.replace(plan, scenarios=match_scenarios(plan.points, plan.option, placed))


def match_scenarios(
    points: NDArray[np.float64], option: NDArray[np.int8], placed: Sequence[PlacedScenario]
) -> tuple[ScenarioTrigger, ...]:
    """The scenarios that begin along a route.

    Args:
        points: (R, 4) x, y, z [m], yaw [rad] of the dense route.
        option: (R,) RoadOption.
        placed: Of the route's town; numbers that are not `STAGED` are left out.

    Returns:
        By ascending point, one a point.
    """
    turn = _next_turns(option)
    groups: list[list[_Candidate]] = []
    for index, point in _first_matches(points, placed):
        subtype = _subtype(placed[index].number, RoadOption(int(turn[point])))
        if subtype is None:
            continue
        candidate = _Candidate(placed[index], subtype, point)
        group = next((g for g in groups if _same_trigger(g[0].place, candidate.place)), None)
        if group is None:
            groups.append(group := [])
        group.append(candidate)
    starts: dict[int, _Candidate] = {}
    for candidate in _one_a_group(groups):
        start = _start(points, candidate, starts)
        if start is not None:
            starts[start] = candidate
    return tuple(
        ScenarioTrigger(type=starts[start].place.number, subtype=starts[start].subtype, point=start)
        for start in sorted(starts)
    )


def _first_matches(
    points: NDArray[np.float64], placed: Sequence[PlacedScenario]
) -> list[tuple[int, int]]:
    """Each trigger that the route passes, in the order of the file, with its first such point."""
    poses = np.array([place[1:] for place in placed], dtype=np.float64).reshape(-1, 4)
    staged = np.isin([place.number for place in placed], STAGED)
    # one axis alone leaves few pairs to look at closely
    near = (np.abs(poses[:, None, 0] - points[None, :, 0]) < MATCH_M) & staged[:, None]
    trigger, point = np.nonzero(near)
    offset = poses[trigger] - points[point]
    turn = np.abs((offset[:, 3] + math.pi) % (2.0 * math.pi) - math.pi)
    fits = (np.linalg.norm(offset[:, :3], axis=1) < MATCH_M) & (turn < MATCH_RAD)
    trigger, point = trigger[fits], point[fits]
    _, first = np.unique(trigger, return_index=True)
    return [(int(trigger[i]), int(point[i])) for i in first]


def _next_turns(option: NDArray[np.int8]) -> NDArray[np.int8]:
    """(R,) the command at the next turn from each point on, VOID after the last."""
    turning = np.flatnonzero(~np.isin(option, _NOT_TURNS))
    commands = np.append(option[turning], np.int8(RoadOption.VOID))
    return commands[np.searchsorted(turning, np.arange(len(option)))]


def _subtype(number: int, turn: RoadOption) -> str | None:
    """The variant, empty where there is one only; None where the route does not turn that way."""
    return SUBTYPES[number].get(turn) if number in SUBTYPES else ""


def _same_trigger(a: PlacedScenario, b: PlacedScenario) -> bool:
    """Whether two triggers are one place to the Leaderboard, which forgets the height here."""
    turn = abs((a.yaw_rad - b.yaw_rad + math.pi) % (2.0 * math.pi) - math.pi)
    return math.hypot(a.x - b.x, a.y - b.y) < MATCH_M and turn < MATCH_RAD


def _one_a_group(groups: list[list[_Candidate]]) -> list[_Candidate]:
    """Of each group the highest number, the last of equals, that is at no place chosen before."""
    chosen: list[_Candidate] = []
    for group in groups:
        ranked = sorted(group, key=lambda candidate: candidate.place.number)[::-1]
        free = (
            candidate
            for candidate in ranked
            if not any(_same_trigger(candidate.place, other.place) for other in chosen)
        )
        chosen.extend([candidate for candidate in [next(free, None)] if candidate is not None])
    return chosen


def _start(
    points: NDArray[np.float64], candidate: _Candidate, taken: dict[int, _Candidate]
) -> int | None:
    """The route point nearest to a trigger, None where the route stays away from it.

    Where another scenario begins there, this one does a point later.
    """
    after = points[candidate.point :, :3]
    away_m = np.linalg.norm(after - np.array(candidate.place[1:4]), axis=1)
    near = away_m < START_M
    if not near.any():
        return None
    first = int(np.argmax(near))
    passed = first + int(np.argmax(np.append(~near[first:], True)))  # it may come back later
    nearest = candidate.point + first + int(np.argmin(away_m[first:passed]))
    return next((point for point in range(nearest, len(points)) if point not in taken), None)
