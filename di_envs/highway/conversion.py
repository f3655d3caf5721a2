"""A town and its traffic as highway-env objects: for its controllers, its viewer and comparisons.

highway-env (Leurent: An environment for autonomous driving decision-making, 2018) names a lane by
(from node, to node, number from the left). Here an edge is a bundle of neighbouring lanes, and
nodes are where bundles link. World frames agree: x east, y south, angles clockwise.
It imports pandas, matplotlib and pygame, 2.4 s of work, and so is imported where it is used.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from di_envs.town.lanes import LaneKind, Lanes
from di_envs.town.town import Town
from di_envs.world.state import ActorKind
from di_envs.world.world import WorldView

if TYPE_CHECKING:
    from highway_env.road.lane import AbstractLane
    from highway_env.road.road import Road, RoadNetwork
    from highway_env.vehicle.behavior import IDMVehicle
    from highway_env.vehicle.objects import Obstacle

LaneIndex = tuple[str, str, int]

STRAIGHT_WITHIN_M = 0.02  # lanes that bend less become straight ones, which are faster there
VEHICLES = (
    ActorKind.CAR,
    ActorKind.VAN,
    ActorKind.TRUCK,
    ActorKind.BUS,
    ActorKind.MOTORCYCLE,
    ActorKind.BICYCLE,
)
# poles and vending machines stand beside the road, and one drives over debris
OFF_ROAD = (ActorKind.ABSENT, ActorKind.PROP, ActorKind.DEBRIS, ActorKind.VENDING_MACHINE)


def lane_indices(town: Town) -> dict[int, LaneIndex]:
    """highway-env's name of each driving lane of a town, by our lane index."""
    lanes = town.lanes
    bundles = list(_bundles(lanes))
    bundle_of = {lane: i for i, bundle in enumerate(bundles) for lane in bundle}
    nodes = _nodes(lanes, bundle_of, len(bundles))
    edges: dict[tuple[str, str], list[tuple[int, ...]]] = {}
    for i, bundle in enumerate(bundles):
        edges.setdefault((nodes[2 * i], nodes[2 * i + 1]), []).append(bundle)
    return {
        lane: (start, end, number)
        for (start, end), parallel in edges.items()
        for number, lane in enumerate(_from_left(lanes, parallel))
    }


def to_road_network(town: Town, only: Iterable[int] | None = None) -> RoadNetwork:
    """A town's driving lanes as a highway-env road network.

    Args:
        town: The town.
        only: Lanes to take; whole edges come with them, so that their numbers stay. All if None.
    """
    from highway_env.road.road import RoadNetwork

    names = lane_indices(town)
    wanted = None if only is None else {names[lane][:2] for lane in only}
    network = RoadNetwork()
    for lane, name in names.items():  # in order of number within each edge
        if wanted is None or name[:2] in wanted:
            network.add_lane(name[0], name[1], to_lane(town.lanes, lane))
    return network


def to_lane(lanes: Lanes, lane: int) -> AbstractLane:
    """A lane of ours as a highway-env lane: straight if it is, else through its points."""
    from highway_env.road.lane import StraightLane

    from di_envs.highway.lane import SampledLane

    first, count = int(lanes.first[lane]), int(lanes.count[lane])
    points = lanes.points[first : first + count]
    width = float(lanes.width_m[first : first + count].mean())
    limit = float(lanes.speed_limit_mps[lane])
    start, end = points[0, :2], points[-1, :2]
    chord, offsets = end - start, points[:, :2] - start
    across = np.abs(chord[0] * offsets[:, 1] - chord[1] * offsets[:, 0])
    if float(across.max()) < STRAIGHT_WITHIN_M * float(np.hypot(*chord)):
        return StraightLane(start.copy(), end.copy(), width=width, speed_limit=limit)
    return SampledLane(points[:, (0, 1, 3)], width, limit)


def to_highway_road(view: WorldView, network: RoadNetwork | None = None) -> Road:
    """The scene as a highway-env road: vehicles, egos first, and obstacles for walkers.

    Props are left out: highway-env would stop for poles a metre beside a lane.

    Args:
        view: The world.
        network: The town's network, if it is already made; it may lack lanes, and who is on these
            is left out.

    Returns:
        A road whose vehicles are `IDMVehicle`s, placed on the lanes that the state says.
    """
    from highway_env.road.road import Road

    network = network or to_road_network(view.town)
    names = lane_indices(view.town)
    # The seed does not matter to us: highway-env's draws only choose lanes for vehicles at random.
    road = Road(
        network,
        np_random=np.random.RandomState(0),
        neighbour_vehicles_connected_lanes=True,
    )
    state = view.state
    for actor in range(state.kind.size):
        kind = int(state.kind[actor])
        if kind in VEHICLES and state.lane[actor] >= 0:
            name = names.get(int(state.lane[actor]))
            if name is not None and name[1] in network.graph.get(name[0], {}):
                road.vehicles.append(to_vehicle(view, actor, road, name))
        elif kind not in OFF_ROAD:
            road.objects.append(to_obstacle(view, actor))
    return road


def to_vehicle(view: WorldView, actor: int, road: Road, lane_index: LaneIndex) -> IDMVehicle:
    """An actor as a vehicle with highway-env's driver model, on the lane that we know it on.

    The vehicle is made without its road: highway-env would search all lanes for the nearest.
    """
    from highway_env.vehicle.behavior import IDMVehicle

    state = view.state
    vehicle = IDMVehicle(
        None,
        [float(state.x[actor]), float(state.y[actor])],
        heading=float(state.yaw[actor]),
        speed=float(state.speed[actor]),
        target_lane_index=lane_index,
        timer=(actor % 20) / 20.0 + 0.05,
    )
    vehicle.road = road
    vehicle.lane_index = lane_index
    vehicle.lane = road.network.get_lane(lane_index)
    vehicle.target_speed = float(vehicle.lane.speed_limit)
    _set_size(vehicle, 2.0 * state.half_length[actor], 2.0 * state.half_width[actor])
    return vehicle


def to_obstacle(view: WorldView, actor: int) -> Obstacle:
    """A walker, or a cyclist who crosses, as an obstacle; on no lane until somebody looks."""
    from highway_env.vehicle.objects import Obstacle

    state = view.state
    obstacle = Obstacle(
        None,
        [float(state.x[actor]), float(state.y[actor])],
        heading=float(state.yaw[actor]),
        speed=float(state.speed[actor]),
    )
    _set_size(obstacle, 2.0 * state.half_length[actor], 2.0 * state.half_width[actor])
    return obstacle


def _set_size(body: Any, length_m: float, width_m: float) -> None:
    body.LENGTH, body.WIDTH = float(length_m), float(width_m)
    body.diagonal = math.hypot(length_m, width_m)


def _bundles(lanes: Lanes) -> Iterator[tuple[int, ...]]:
    """Neighbouring driving lanes of one direction, from left to right."""
    for lane in range(lanes.kind.size):
        if lanes.kind[lane] != LaneKind.DRIVING or lanes.left[lane] >= 0:
            continue
        bundle = [lane]
        while lanes.right[bundle[-1]] >= 0:
            bundle.append(int(lanes.right[bundle[-1]]))
        yield tuple(bundle)


def _successors(lanes: Lanes, lane: int) -> list[int]:
    span = slice(lanes.successor_start[lane], lanes.successor_start[lane + 1])
    return [int(other) for other in lanes.successor[span]]


def _nodes(lanes: Lanes, bundle_of: dict[int, int], bundles: int) -> list[str]:
    """Names of the nodes at the start (2 i) and end (2 i + 1) of each bundle i.

    An end and a start are one node when a lane of one leads to a lane of the other (union-find).
    """
    parent = list(range(2 * bundles))

    def root(node: int) -> int:
        while parent[node] != node:
            parent[node] = parent[parent[node]]
            node = parent[node]
        return node

    for lane, bundle in bundle_of.items():
        for other in _successors(lanes, lane):
            a, b = root(2 * bundle + 1), root(2 * bundle_of[other])
            parent[max(a, b)] = min(a, b)
    return [str(root(node)) for node in range(2 * bundles)]


def _from_left(lanes: Lanes, bundles: list[tuple[int, ...]]) -> list[int]:
    """The lanes of parallel bundles, from left to right where they begin."""
    if len(bundles) == 1:
        return list(bundles[0])
    every = [lane for bundle in bundles for lane in bundle]
    x0, y0, _, yaw = lanes.points[lanes.first[every[0]]]

    def across(lane: int) -> tuple[float, float]:
        """Offset to the right of the first one's start; those that start together, at the end."""
        first, last = lanes.first[lane], lanes.first[lane] + lanes.count[lane] - 1
        starts, ends = lanes.points[first], lanes.points[last]
        right = -math.sin(yaw) * (starts[0] - x0) + math.cos(yaw) * (starts[1] - y0)
        turned = -math.sin(yaw) * (ends[0] - x0) + math.cos(yaw) * (ends[1] - y0)
        return round(right, 1), float(turned)

    return sorted(every, key=across)
