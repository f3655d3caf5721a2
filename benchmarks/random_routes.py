"""Writes random routes over any town, to drive where nobody laid any.

    python benchmarks/random_routes.py Town04.xodr town04_random.xml
    driveinsight evaluate --agent expert --town Town04.xodr --routes town04_random.xml

Begins and ends are drawn on driving lanes outside of junctions; between them routes are planned by
CARLA's rules, and kept if they are 300 to 1,500 m long. Prints what the town has. A map without
signals needs `--signals synthesise`, here and there.
"""

from __future__ import annotations

import argparse
import random
from pathlib import Path

import numpy as np

from di_envs.town.lanes import LaneKind, SignalKind
from di_envs.town.loading import load_town
from di_envs.town.routing.road_graph import RoadGraph, build_road_graph
from di_envs.town.routing.router import RouteError, plan_route
from di_envs.town.routing.routes import Keypoint, RouteSpec, write_routes
from di_envs.town.town import Town
from di_envs.traffic_level import driving_lanes_m, usual_traffic

TRIES_A_ROUTE = 200  # before a town counts as too small for so long routes


def random_routes(
    graph: RoadGraph, count: int, seed: int, shortest_m: float, longest_m: float
) -> list[RouteSpec]:
    """So many routes, or as many as a few hundred tries for each give."""
    town, dice = graph.town, random.Random(seed)
    lanes = town.lanes
    streets = np.flatnonzero((lanes.kind == LaneKind.DRIVING) & (lanes.junction < 0))
    points = np.concatenate(
        [np.arange(lanes.first[lane], lanes.first[lane] + lanes.count[lane]) for lane in streets]
    )
    routes: list[RouteSpec] = []
    for _ in range(count * TRIES_A_ROUTE):
        if len(routes) == count:
            break
        ends = lanes.points[[points[dice.randrange(len(points))] for _ in range(2)]]
        try:
            plan = plan_route(town, ends[:, :3], route_id=str(len(routes)), graph=graph)
        except RouteError:
            continue
        if shortest_m <= plan.length_m <= longest_m:
            keypoints = tuple(
                Keypoint(x, y, z, yaw_deg=float(np.degrees(yaw))) for x, y, z, yaw in ends.tolist()
            )
            routes.append(RouteSpec(route_id=str(len(routes)), town=town.name, keypoints=keypoints))
    return routes


def words_about(town: Town) -> str:
    """What a town has: lanes, lights, signs, and its usual traffic."""
    kinds, level = town.signals.kind, usual_traffic(town.lanes)
    return (
        f"{town.name}: {driving_lanes_m(town.lanes) / 1000.0:.1f} km of lanes, "
        f"{len(town.junction_names)} junctions, {(kinds == SignalKind.LIGHT).sum()} lights, "
        f"{(kinds != SignalKind.LIGHT).sum()} signs, usually {level.vehicles} vehicles and "
        f"{level.walkers} walkers"
    )


def main() -> None:
    """Writes the routes of one town."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("town", help="shipped name or file")
    parser.add_argument("output", type=Path, help="route file to write")
    parser.add_argument("--signals", help="as for `driveinsight evaluate`")
    parser.add_argument("--routes", type=int, default=20)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--length-m", type=float, nargs=2, default=(300.0, 1500.0))
    options = parser.parse_args()
    town = load_town(options.town, options.signals)
    routes = random_routes(build_road_graph(town), options.routes, options.seed, *options.length_m)
    write_routes(options.output, routes)
    print(f"{words_about(town)}; {len(routes)} routes in {options.output}")


if __name__ == "__main__":
    main()
