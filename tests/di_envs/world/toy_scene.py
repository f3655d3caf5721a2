"""Traffic scenes made by hand in the toy town, on whose lanes one can say where everybody stands.

See `di_envs.town.building.toy` for the town. Lanes are named here by where they lead, as on a map.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from di_envs.town.loading import load_town
from di_envs.town.plan import RoutePlan
from di_envs.world.state import PATH_LANES, TICK_S, ActorKind, State, views_of
from di_envs.world.traffic.motion import place_vehicle
from di_envs.world.world import World, WorldConfig

# The western street, driven north and east to junction 1 (lights): left and right lane
WEST_TO_1, WEST_TO_1_RIGHT = ("11", 1), ("11", 2)
# … and west, south and east along the south side to junction 2 (the major road there)
WEST_TO_2, WEST_TO_2_RIGHT = ("11", -1), ("11", -2)
EAST_TO_1, EAST_TO_2, EAST_TO_2_RIGHT = ("12", 1), ("12", -1), ("12", -2)
MIDDLE_TO_2, MIDDLE_TO_1 = ("13", -1), ("13", 1)  # a stop sign at 2, lights at 1
# Ways through junction 2
MIDDLE_RIGHT, MIDDLE_LEFT = ("2016", -1), ("2017", -1)
FROM_WEST_STRAIGHT, FROM_WEST_LEFT, FROM_EAST_STRAIGHT = ("2012", -1), ("2013", -1), ("2014", -1)
FROM_EAST_RIGHT = ("2015", -1)
# Ways through junction 1
NORTH_STRAIGHT, NORTH_STRAIGHT_RIGHT, NORTH_RIGHT = ("2003", -1), ("2003", -2), ("2004", -1)
MIDDLE_RIGHT_AT_1 = ("2008", -1)

Name = tuple[str, int]


class ToyScene:
    """A town with nobody in it but whom a test puts there: egos, then vehicles, walkers."""

    def __init__(
        self,
        vehicles: int = 1,
        walkers: int = 0,
        plans: tuple[RoutePlan, ...] = (),
        town: str = "toy",
    ):
        self.town = load_town(town)
        self.world = World(self.town, WorldConfig(vehicles=vehicles, walkers=walkers))
        self.world.reset(0, plans)
        self.egos, self.end = len(plans), len(plans) + vehicles + walkers
        with self.edit() as state:
            state.kind[self.egos : self.end] = ActorKind.ABSENT

    @property
    def state(self) -> State:
        return self.world.view.state

    @contextmanager
    def edit(self) -> Iterator[State]:
        """The state, writable, put back at the end."""
        snapshot = self.world.save()
        yield views_of(snapshot.record)
        self.world.restore(snapshot)

    def lane(self, name: Name | int) -> int:
        if isinstance(name, int):
            return name
        lanes = self.town.lanes
        road = self.town.road_names.index(name[0])
        (lane,) = np.flatnonzero((lanes.road == road) & (lanes.lane_id == name[1]))
        return int(lane)

    def room(self, name: Name) -> float:
        return float(self.town.lanes.length_m[self.lane(name)])

    def put(
        self,
        actor: int,
        path: Sequence[Name | int],
        before_end_m: float,
        speed: float = 0.0,
        kind: ActorKind = ActorKind.CAR,
        factor: float = 1.0,
    ) -> None:
        """Puts a 4 m car with its front so far before the end of the first lane of its path."""
        lanes = self.town.lanes
        way = [self.lane(name) for name in path]
        while len(way) < PATH_LANES:
            way.append(int(lanes.successor[lanes.successor_start[way[-1]]]))
        with self.edit() as state:
            state.kind[actor], state.speed[actor] = kind, speed
            state.half_length[actor], state.half_width[actor] = 2.0, 0.9
            state.desired_factor[actor] = factor
            state.path[actor], state.lane[actor] = way, way[0]
            state.lane_m[actor] = lanes.length_m[way[0]] - before_end_m - 2.0
            place_vehicle(state, lanes, actor)

    def put_walker(self, walker: int, edge: int, station: float, direction: int = 1) -> None:
        """Puts a walker onto an edge of the walking graph, where its line is."""
        walk = self.world._scenery.walk
        point = walk.points[walk.first[edge] + round(station / walk.spacing_m[edge])]
        with self.edit() as state:
            state.kind[walker] = ActorKind.WALKER
            state.walk_edge[walker], state.walk_m[walker] = edge, station
            state.walk_direction[walker] = direction
            state.half_length[walker] = state.half_width[walker] = 0.25
            state.desired_factor[walker] = 1.0
            state.x[walker], state.y[walker], state.z[walker], state.yaw[walker] = point

    def to_end_m(self, actor: int, name: Name) -> float:
        """From a vehicle's front to the end of a lane; negative once it is past it."""
        lanes, state = self.town.lanes, self.state
        lane = self.lane(name)
        if state.lane[actor] != lane:
            return -1.0
        return float(lanes.length_m[lane] - state.lane_m[actor] - state.half_length[actor])

    def show(self, junction: str, group: int, ticks: int = 0) -> None:
        """Makes it a group's turn at a junction, since so many ticks."""
        index = self.town.junction_names.index(junction)
        with self.edit() as state:
            state.phase_group[index], state.phase_ticks[index] = group, ticks

    def run(self, seconds: float) -> Iterator[State]:
        """Lets time pass; gives the state after each tick."""
        controls = np.tile([0.0, 0.0, 1.0], (self.egos, 1))  # egos stand on their brakes
        for _ in range(round(seconds / TICK_S)):
            self.world.advance(controls)
            yield self.state
