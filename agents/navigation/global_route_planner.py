"""`GlobalRoutePlanner` for agents for CARLA: the shortest way over a map, with its road options.

It asks the map for nothing but waypoints, so it plans on `carla.Map` of the wheel as on ours.
Source: interface of CARLA's `agents.navigation.global_route_planner` (MIT licence); our own code.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from typing import Any

from di_envs.town.plan import RoadOption

Trace = list[tuple[Any, RoadOption]]  # waypoints with what to do there
CHANGE_M = 8.0  # that a lane change takes along the road
CHANGE_COST_M = 10.0  # a change is worth a detour of so much
STRAIGHT_RAD = math.radians(35.0)  # a way through a junction that turns less is straight on
EDGE_M = 3.0  # into a junction, within which it is not told by a place which way through is meant
MOST_PLACES = 50_000  # that are looked at before the search is given up


class NoWayError(RuntimeError):
    """No way leads from one place to another."""


class GlobalRoutePlanner:
    """Plans on a map.

    Args:
        wmap: A map with `get_waypoint`, or what 0.9.10 wraps round one (`get_map`).
        sampling_resolution: Metres between two waypoints.
    """

    def __init__(self, wmap: Any, sampling_resolution: float = 2.0) -> None:
        self._wmap = wmap.get_map() if hasattr(type(wmap), "get_map") else wmap
        self._resolution_m = float(sampling_resolution)

    def setup(self) -> None:
        """Nothing to do: agents for 0.9.10 call it."""

    def trace_route(self, origin: Any, destination: Any) -> Trace:
        """The shortest way.

        Args:
            origin: A `carla.Location`.
            destination: Another.

        Returns:
            Waypoints from the lane place nearest the one to that nearest the other.

        Raises:
            NoWayError: If none leads there.
        """
        start, goal = self._wmap.get_waypoint(origin), self._wmap.get_waypoint(destination)
        if start is None or goal is None:
            raise NoWayError(f"no lane is near {origin if start is None else destination}")
        return with_turns(self._search(_beside_junction(start), _beside_junction(goal)))

    def _search(self, start: Any, goal: Any) -> Trace:
        """A* over places along lanes."""
        end = goal.transform.location
        known: dict[tuple[int, int, int, int], float] = {}
        queue: list[tuple[float, int, float, Any, int, RoadOption]] = [
            (0.0, 0, 0.0, start, -1, RoadOption.LANEFOLLOW)
        ]
        reached: list[tuple[Any, int, RoadOption]] = []
        count = 0
        while queue and len(reached) < MOST_PLACES:
            _, _, cost_m, waypoint, parent, option = heapq.heappop(queue)
            key = self._key(waypoint)
            if known.get(key, math.inf) <= cost_m:
                continue
            known[key] = cost_m
            reached.append((waypoint, parent, option))
            here = len(reached) - 1
            if _lane_of(waypoint) == _lane_of(goal) and self._is_near(waypoint, goal):
                return _ending(_way_back(reached, here), goal)
            for beyond, add_m, beyond_option in self._ahead(waypoint, goal):
                count += 1
                far_m = beyond.transform.location.distance(end)
                total_m = cost_m + add_m
                row = (total_m + far_m, count, total_m, beyond, here, beyond_option)
                heapq.heappush(queue, row)
        raise NoWayError(f"no way leads from {start} to {goal}")

    def _ahead(self, waypoint: Any, goal: Any) -> Iterator[tuple[Any, float, RoadOption]]:
        """Places that can be reached next: metres, and how."""
        for beyond in waypoint.next(self._resolution_m):
            yield beyond, self._resolution_m, RoadOption.LANEFOLLOW
        if waypoint.is_junction:
            return
        allowed = waypoint.lane_change.name
        sides = (
            ("Left", waypoint.get_left_lane, RoadOption.CHANGELANELEFT),
            ("Right", waypoint.get_right_lane, RoadOption.CHANGELANERIGHT),
        )
        for side, neighbour, option in sides:
            beside = neighbour() if allowed in (side, "Both") else None
            if beside is None or beside.lane_id * waypoint.lane_id < 0:
                continue
            if _lane_of(beside) == _lane_of(goal) and self._is_near(beside, goal, CHANGE_M):
                yield goal, CHANGE_COST_M, option  # too near to be changed to as others are
            for beyond in beside.next(CHANGE_M):
                if beyond.lane_type == waypoint.lane_type:
                    yield beyond, CHANGE_M + CHANGE_COST_M, option

    def _key(self, waypoint: Any) -> tuple[int, int, int, int]:
        """The same for places close together: finer than steps, so that none is left out."""
        return (*_lane_of(waypoint), round(4.0 * waypoint.s / self._resolution_m))

    def _is_near(self, waypoint: Any, goal: Any, ahead_m: float = 0.0) -> bool:
        """Whether a goal on the same lane is within a step, or so far ahead."""
        place, there = waypoint.transform, goal.transform.location
        far_m = place.location.distance(there)
        if far_m <= self._resolution_m + 0.01:
            return True
        return bool(far_m <= ahead_m and _is_ahead(place, there))


def _lane_of(waypoint: Any) -> tuple[int, int, int]:
    return waypoint.road_id, waypoint.section_id, waypoint.lane_id


def _is_ahead(place: Any, there: Any) -> bool:
    way = place.get_forward_vector()
    return bool((there.x - place.location.x) * way.x + (there.y - place.location.y) * way.y > 0.0)


def _ending(way: Trace, goal: Any) -> Trace:
    """The same way, which ends at the goal itself."""
    last, option = way[-1]
    kept = way if _is_ahead(last.transform, goal.transform.location) else way[:-1]
    return [*kept, (goal, option)]


def _beside_junction(waypoint: Any) -> Any:
    """Just before or behind a junction for one at its edge: there all its lanes lie together."""
    if not waypoint.is_junction:
        return waypoint
    for far_m in (0.5, 1.0, 2.0, EDGE_M):
        for found in (waypoint.previous(far_m), waypoint.next(far_m)):
            if found and not found[0].is_junction:
                return found[0]
    return waypoint


def _way_back(reached: list[tuple[Any, int, RoadOption]], last: int) -> Trace:
    way: Trace = []
    while last >= 0:
        waypoint, last_parent, option = reached[last]
        way.append((waypoint, option))
        last = last_parent
    return way[::-1]


def with_turns(way: Trace) -> Trace:
    """The same way, with what each junction on it asks for: left, right or straight on."""
    found = list(way)
    first = 0
    while first < len(way):
        if not way[first][0].is_junction:
            first += 1
            continue
        end = first
        while end < len(way) and way[end][0].is_junction:
            end += 1
        turn = _turn_of(way[max(first - 1, 0)][0], way[min(end, len(way) - 1)][0])
        found[first:end] = [(waypoint, turn) for waypoint, _ in way[first:end]]
        first = end
    return found


def _turn_of(before: Any, after: Any) -> RoadOption:
    yaw_deg = after.transform.rotation.yaw - before.transform.rotation.yaw
    turn = math.remainder(math.radians(yaw_deg), 2.0 * math.pi)
    if abs(turn) < STRAIGHT_RAD:
        return RoadOption.STRAIGHT
    return RoadOption.RIGHT if turn > 0.0 else RoadOption.LEFT


__all__ = ["GlobalRoutePlanner", "NoWayError", "RoadOption"]
