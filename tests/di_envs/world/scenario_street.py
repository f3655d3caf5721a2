"""A street on which scenarios can be followed on paper: the piece of road of `small_world`.

The ego's route runs east along y = 0: a two-lane street to x = 100 (the right lane at y = 3.5,
beyond it parking from x = 20 to 60), a junction with lights to x = 120, one lane from there on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from di_envs.town.lanes import SignalKind, Signals
from di_envs.town.plan import RoutePlan, ScenarioTrigger
from di_envs.town.town import Town
from di_envs.world.state import TICK_S, State, views_of
from di_envs.world.world import Event, World, WorldConfig
from tests.di_envs.world.small_world import EAST, EAST_RIGHT, EXIT, JUNCTION, make_lanes, make_town

LENGTH = 220
FROM_WEST, FROM_NORTH, FROM_EAST = 0, 1, 2  # heads: the ego's, that of the left arm, the opposite


def street() -> Town:
    """The town: its right lane is linked to the left one, three arms have lights."""
    lanes = make_lanes()
    right = lanes.right.copy()
    right[EAST] = EAST_RIGHT
    yaws = np.array([0.0, 0.5 * math.pi, math.pi])
    boxes = np.zeros((3, 6))
    boxes[:, :2] = [[97.0, 0.0], [110.0, -15.0], [137.0, -3.5]]
    poles = np.column_stack((np.array([[100.0, 7], [104, -15], [122, -12]]), np.zeros(3), yaws))
    signals = Signals(
        kind=np.full(3, SignalKind.LIGHT, np.int8),
        junction=np.zeros(3, np.int32),
        group=np.arange(3, dtype=np.int32),
        pose=poles,
        box=boxes,
        stop_signal=np.zeros(2, np.int32),
        stop_lane=np.array([EAST, EAST_RIGHT], np.int32),
        stop_pose=np.array([[100.0, 0.0, 0.0, 0.0], [100.0, 3.5, 0.0, 0.0]]),
        stop_width_m=np.full(2, 3.5),
        groups=np.array([3], np.int32),
    )
    return make_town(lanes._replace(right=right), signals)


def route(*scenarios: tuple[int, str, int], y: float = 0.0) -> RoutePlan:
    """The route, a point each metre, with triggers (type, subtype, metre)."""
    x = np.arange(LENGTH + 1.0)
    points = np.zeros((x.size, 4))
    points[:, 0], points[:, 1] = x, y
    near = EAST if y == 0.0 else EAST_RIGHT
    return RoutePlan(
        route_id="0",
        town="piece",
        keypoints=points[[0, -1], :3],
        points=points,
        option=np.full(x.size, 4, np.int8),
        lane=np.where(x < 100, near, np.where(x < 120, JUNCTION, EXIT)).astype(np.int32),
        lane_m=np.where(x < 100, x, np.where(x < 120, x - 100, x - 120)),
        route_m=x.copy(),
        targets=np.array([50, LENGTH], np.int32),
        scenarios=tuple(ScenarioTrigger(type=t, subtype=s, point=p) for t, s, p in scenarios),
    )


class Street:
    """A world with one ego on the street, or more, and nobody else; the egos are led by hand."""

    def __init__(self, *scenarios: tuple[int, str, int], seed: int = 0, egos: int = 1) -> None:
        self.world = World(street(), WorldConfig(vehicles=0, walkers=0))
        plans = [route(*scenarios, y=3.5 * ego) for ego in range(egos)]
        self.world.reset(seed, tuple(plans))
        self.egos = egos
        self.events: list[Event] = []

    @property
    def state(self) -> State:
        return self.world.view.state

    @contextmanager
    def edit(self) -> Iterator[State]:
        """The state, writable, put back at the end."""
        snapshot = self.world.save()
        yield views_of(snapshot.record)
        self.world.restore(snapshot)

    def lead(self, x: float, speed: float = 0.0, ego: int = 0, ticks: int = 1) -> State:
        """Puts an ego at x with a speed, lets it roll for some ticks, returns the state."""
        with self.edit() as state:
            state.x[ego], state.y[ego], state.yaw[ego] = x, 3.5 * ego, 0.0
            state.speed[ego], state.wheel[ego] = speed, 0.0
        self.events += self.world.advance(np.zeros((self.egos, 3)), ticks)
        return self.state

    def wait(self, seconds: float) -> State:
        """Lets time pass while the egos stand on their brakes."""
        brakes = np.tile([0.0, 0.0, 1.0], (self.egos, 1))
        self.events += self.world.advance(brakes, round(seconds / TICK_S))
        return self.state
