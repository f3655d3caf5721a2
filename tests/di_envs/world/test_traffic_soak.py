"""Ten minutes of traffic and walkers among themselves: no collision, no gridlock, no law broken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from di_envs.numerics.geometry import boxes_overlap
from di_envs.numerics.kernels import kernel
from di_envs.town.lanes import LightState, SignalKind
from di_envs.town.loading import load_town
from di_envs.town.town import Town
from di_envs.world.state import TICK_S, ActorKind, State
from di_envs.world.world import World, WorldConfig

MINUTES = 10
VEHICLES, WALKERS = 120, 60
_ABSENT, _WALKER, _PROP = int(ActorKind.ABSENT), int(ActorKind.WALKER), int(ActorKind.PROP)


@kernel
def overlapping_pair(kind, x, y, z, yaw, half_length, half_width):
    """The first two actors whose boxes overlap at one level, or (-1, -1).

    Walkers and poles are left out: a pole may stand on a sidewalk, and walkers slip past it.
    """
    for a in range(kind.size):
        for b in range(a + 1, kind.size):
            dx, dy = x[a] - x[b], y[a] - y[b]
            if dx * dx + dy * dy > 150.0 or abs(z[a] - z[b]) > 3.0:
                continue
            if kind[a] == _ABSENT or kind[b] == _ABSENT or kind[a] == _PROP:
                continue
            if kind[a] == _WALKER and kind[b] == _PROP:
                continue
            if boxes_overlap(
                x[a], y[a], yaw[a], half_length[a], half_width[a],
                x[b], y[b], yaw[b], half_length[b], half_width[b],
            ):  # fmt: skip
                return a, b
    return -1, -1


class LineWatch:
    """Notes every vehicle whose front crosses a stop line, and whether it was allowed to."""

    def __init__(self, town: Town) -> None:
        self.town = town
        self.reds: list[tuple[int, int]] = []
        self.unstopped: list[tuple[int, int]] = []
        self.crossings = 0
        self.before: dict[int, int] = {}
        self.stopped: dict[int, int] = {}

    def look(self, state: State, vehicles: range) -> None:
        for actor in vehicles:
            lane, room = self._front(state, actor)
            line = int(self.town.lanes.stop_line[lane])
            if line >= 0 and room < 4.0 and state.speed[actor] < 0.1:
                self.stopped[actor] = line
            before = self.before.get(actor, lane)
            if before != lane and self.town.lanes.junction[lane] >= 0:
                self._cross(actor, int(self.town.lanes.stop_line[before]), state)
            self.before[actor] = lane

    def _front(self, state: State, actor: int) -> tuple[int, float]:
        """The lane on which a vehicle's front is, and how far that is from the lane's end."""
        lengths = self.town.lanes.length_m
        front = float(state.lane_m[actor] + state.half_length[actor])
        for lane in state.path[actor].tolist():
            if front <= lengths[lane]:
                break
            front -= float(lengths[lane])
        return lane, float(lengths[lane]) - front

    def _cross(self, actor: int, line: int, state: State) -> None:
        if line < 0:
            return
        signal = int(self.town.signals.stop_signal[line])
        tick = int(state.tick)
        self.crossings += 1
        if self.town.signals.kind[signal] == SignalKind.LIGHT:
            if state.light[signal] == LightState.RED:
                self.reds.append((tick, actor))
        elif self.town.signals.kind[signal] == SignalKind.STOP:
            if self.stopped.get(actor) != line:
                self.unstopped.append((tick, actor))
            self.stopped.pop(actor, None)


def soak(town: Town, seed: int, minutes: float) -> tuple[World, LineWatch, float, int]:
    """Runs traffic alone; returns the world, the line watch, the mean speed, the longest stand."""
    world = World(town, WorldConfig(vehicles=VEHICLES, walkers=WALKERS))
    world.reset(seed, ())
    state = world.view.state
    watch, speeds, longest = LineWatch(town), [], 0
    none = np.zeros((0, 3))
    for tick in range(round(minutes * 60.0 / TICK_S)):
        world.advance(none)
        pair = overlapping_pair(
            state.kind, state.x, state.y, state.z, state.yaw, state.half_length, state.half_width
        )
        if pair[0] >= 0:
            kinds = [ActorKind(int(state.kind[i])).name for i in pair]
            where = (round(float(state.x[pair[0]]), 1), round(float(state.y[pair[0]]), 1))
            pytest.fail(f"seed {seed}, {tick * TICK_S:.2f} s: {pair} {kinds} collide at {where}")
        watch.look(state, range(VEHICLES))
        if tick % 20 == 0:
            speeds.append(float(state.speed[:VEHICLES].mean()))
            longest = max(longest, int(state.still_ticks[:VEHICLES].max()))
    return world, watch, float(np.mean(speeds)), longest


def check(town: Town, seed: int) -> None:
    _, watch, mean_speed, longest = soak(town, seed, MINUTES)
    print(f"seed {seed}: {watch.crossings} lines crossed, {mean_speed:.2f} m/s", longest * TICK_S)
    assert watch.reds == []
    assert watch.unstopped == []
    assert watch.crossings > 500
    assert longest * TICK_S <= 180.0
    assert mean_speed > 4.0


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_traffic_in_the_shipped_town_keeps_the_law_and_keeps_moving(seed: int) -> None:
    check(load_town("town05"), seed)


@pytest.mark.filterwarnings("ignore:.*:UserWarning")
def test_traffic_in_the_real_town05_keeps_the_law_and_keeps_moving(shared: Path) -> None:
    check(load_town(shared / "data" / "xodr" / "Town05.xodr", signals="town05"), 0)


def test_traffic_gets_through_junctions_that_follow_each_other_at_once(shared: Path) -> None:
    # roads of 0.4 to 6 m join junctions there: cars on them once waited for each other for ever
    world = World(load_town(shared / "data" / "xodr" / "Town04_2020.xodr"), WorldConfig())
    world.reset(0, ())
    longest = 0
    for _ in range(600):
        world.advance(np.zeros((0, 3)), 20)
        longest = max(longest, int(world.view.state.still_ticks[:VEHICLES].max()))
    assert longest * TICK_S <= 180.0


def test_nobody_waits_for_ever_where_town04_is_full(shared: Path) -> None:
    """A lorry that a red light stopped between two junctions met whom it had let in behind it."""
    world = World(
        load_town(shared / "data" / "xodr" / "Town04_2020.xodr"),
        WorldConfig(vehicles=200, walkers=60),
    )
    world.reset(5, ())
    state, longest = world.view.state, 0
    for _ in range(60 * 28):
        world.advance(np.zeros((0, 3)), 20)
        longest = max(longest, int(state.still_ticks[:200].max()))
    assert longest * TICK_S < 240.0  # three rounds of the lights of three junctions in a row
