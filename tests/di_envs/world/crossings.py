"""A street with a crosswalk, and one who stands before it: what tests of walkers share."""

import math
from dataclasses import replace

import numpy as np

from di_envs.town.lanes import Crosswalks, LaneKind, SignalKind
from di_envs.world.state import ActorKind
from di_envs.world.walkers.neighbours import make_neighbours
from di_envs.world.walkers.on_edges import mark_busy_crosswalks, place_on_edge
from di_envs.world.walkers.spawn import spawn_walkers
from di_envs.world.walkers.strolling import move_walkers
from di_envs.world.walkers.walk_graph import build_walk_graph
from tests.di_envs.world.small_world import (
    EAST,
    EAST_RIGHT,
    LANES,
    ONCOMING,
    LaneSpec,
    make_lanes,
    make_signals,
    make_state,
    make_town,
    put,
)

# the street of small_world with a sidewalk on its other side too, and a crosswalk at x = 80 that
# lies on the three driving lanes (y from -5.25 to 5.25)
STREET = make_lanes(
    (
        *LANES,
        LaneSpec(
            start=(0, -10), end=(100, -10), road=0, lane_id=2, kind=LaneKind.SIDEWALK, width=2.0
        ),
    )
)
CROSSWALK = Crosswalks(
    start=np.array([[80.0, 5.5, 0.0]]),
    end=np.array([[80.0, -5.5, 0.0]]),
    width_m=np.array([3.0]),
    crossed_start=np.array([0, 3], np.int32),
    crossed_lane=np.array([EAST, EAST_RIGHT, ONCOMING], np.int32),
    crossed_begin_m=np.array([78.5, 78.5, 18.5]),
    crossed_end_m=np.array([81.5, 81.5, 21.5]),
)
NO_SIGNALS = make_signals(SignalKind.YIELD)
OPEN = make_town(STREET, NO_SIGNALS, CROSSWALK)
WITH_LIGHT = replace(OPEN, signals=make_signals())
KERB = 10.0 - 5.25 - 1.25  # station at which walkers from the south wait


def walk_on(state, walk, first, end, signals=NO_SIGNALS):
    """One tick of the walkers [first, end)."""
    move_walkers(
        state,
        walk,
        signals,
        make_neighbours(state.kind.size, walk.approach_start.size - 1),
        first,
        end,
    )


class Crossing:
    """One walker (actor 2) at the southern kerb, an ego (0, absent) and a vehicle (1, absent)."""

    def __init__(self, town=OPEN):
        self.town, self.walk = town, build_walk_graph(town)
        self.state = make_state(vehicles=1, walkers=1)
        self.state.kind[:] = ActorKind.ABSENT
        self.edge = int(np.flatnonzero(self.walk.crosswalk == 0)[0])
        spawn_walkers(self.state, self.walk, 2, 1)
        self.go(self.edge, KERB - 0.15)
        self.state.desired_factor[2] = 1.5
        self.busy = np.zeros(1, np.int8)

    def tick(self, ticks=1):
        for _ in range(ticks):
            self.state.tick[()] += 1
            walk_on(self.state, self.walk, 2, 3, self.town.signals)
            mark_busy_crosswalks(self.state, self.walk, self.busy)

    def go(self, edge, station, direction=1, walker=2):
        """Puts a walker on an edge."""
        state = self.state
        state.walk_edge[walker], state.walk_m[walker] = edge, station
        state.walk_direction[walker] = direction
        place = place_on_edge(self.walk, edge, station, direction)
        state.x[walker], state.y[walker], state.z[walker], state.yaw[walker] = place

    @property
    def sidewalk(self):
        """The southern sidewalk west of the crosswalk, 80 m long."""
        return next(e for e in range(4) if self.walk.points[self.walk.first[e], 1] == 10.0)

    def car(self, front, lane=EAST, speed=10.0, actor=1):
        """A car whose front is at a station of a lane, on its way along it."""
        spec = LANES[lane]
        heading = math.atan2(spec.end[1] - spec.start[1], spec.end[0] - spec.start[0])
        middle = front - 2.4
        x = spec.start[0] + middle * math.cos(heading)
        put(self.state, actor, ActorKind.CAR, x, spec.start[1], yaw=heading, speed=speed)
        self.state.lane[actor], self.state.lane_m[actor] = lane, middle
        self.state.path[actor, 0] = lane

    @property
    def waits(self):
        return bool(self.state.walk_waiting[2] == 1)


# the graph
