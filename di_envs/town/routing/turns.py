"""The command along a route: left, right or straight through a junction, and where it is said.

A command is decided where a junction is entered and holds on all of its lanes, as in CARLA's global
planner: by how far the way turns, and beside the other ways out of the same place.

Source: behaviour of `agents/navigation/global_route_planner.py` (CARLA Python API, MIT licence);
our own code.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from di_envs.town.plan import RoadOption
from di_envs.town.routing.road_graph import Edge, RoadGraph

STRAIGHT_BELOW_RAD = math.radians(35.0)  # a smaller change of direction is no turn


@dataclass(kw_only=True)
class TurnMemory:
    """What the turn decision remembers from edge to edge, and from one leg to the next."""

    last_option: RoadOption = RoadOption.VOID
    junction_exit: int = -1  # node at which the junction now being crossed is left


def turn_option(graph: RoadGraph, edges: Sequence[Edge], i: int, turns: TurnMemory) -> RoadOption:
    """The command on edge `i`: one for all lanes of a junction, decided where it is entered."""
    edge = edges[i]
    option = edge.option
    if i > 0:
        crossing = edge.in_junction and option == RoadOption.LANEFOLLOW
        before = edges[i - 1]
        if (
            crossing
            and turns.last_option != RoadOption.VOID
            and turns.junction_exit > 0
            and turns.junction_exit != before.source
        ):
            option = turns.last_option
        else:
            turns.junction_exit = -1
            if crossing and before.option == RoadOption.LANEFOLLOW and not before.in_junction:
                tail = _last_in_junction(edges, i)
                turns.junction_exit = tail.target
                option = _turn_of(graph, before, edge, tail)
    turns.last_option = option
    return option


def _last_in_junction(edges: Sequence[Edge], i: int) -> Edge:
    """The last of the junction edges that follow one another from edge `i` on."""
    last = edges[i]
    for edge in edges[i:]:
        if edge.option != RoadOption.LANEFOLLOW or not edge.in_junction:
            break
        last = edge
    return last


def _turn_of(graph: RoadGraph, before: Edge, edge: Edge, tail: Edge) -> RoadOption:
    """Left, right or straight, by direction and by the other ways out of the same node."""
    ahead = before.exit_direction
    others = [
        _cross(ahead, other.chord)
        for node, other in graph.edges[edge.source].items()
        if other.option == RoadOption.LANEFOLLOW and node != edge.target
    ] or [0.0]
    to_right = _cross(ahead, tail.exit_direction)
    cosine = ahead[0] * tail.exit_direction[0] + ahead[1] * tail.exit_direction[1]
    if math.acos(min(1.0, max(-1.0, cosine))) < STRAIGHT_BELOW_RAD:
        return RoadOption.STRAIGHT
    if to_right < min(others):
        return RoadOption.LEFT
    if to_right > max(others):
        return RoadOption.RIGHT
    return RoadOption.LEFT if to_right < 0.0 else RoadOption.RIGHT


def _cross(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Positive where `b` points to the right of `a` (y is south)."""
    return a[0] * b[1] - a[1] * b[0]
