"""Traffic in small towns drawn at random: nobody stands for ever, and nobody hits anybody.

Every third town has lights and stop signs, where a guess from its junctions' shapes puts them.
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np
import pytest

from di_envs.town.lanes import LaneKind, LightState, SignalKind
from di_envs.town.loading import load_town
from di_envs.town.queries import pose_at
from di_envs.town.routing.road_graph import build_road_graph
from di_envs.town.routing.router import plan_route
from di_envs.town.town import Town
from di_envs.world.dynamics import locate_ego
from di_envs.world.state import TICK_S, ActorKind, State, views_of
from di_envs.world.traffic.tables import traffic_tables
from di_envs.world.world import World, WorldConfig
from tests.di_envs.world.small_maps import small_map
from tests.di_envs.world.test_traffic_soak import overlapping_pair

VEHICLES, MINUTES, LOOK_TICKS = 10, 10, 5
STANDS_S = 120.0
STANDS_AT_REDS_S = 300.0  # red after red: in a queue, where others turn left


def small_town(folder: Path, seed: int) -> Town:
    path = folder / f"small{seed}.xodr"
    path.write_text(small_map(seed), encoding="utf-8")
    if seed % 3 != 2:
        return load_town(path, signals="none", cache_folder=folder)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "small.* signals='synthesise' made")
        return load_town(path, signals="synthesise", cache_folder=folder)


def waits_at_red(town: Town, state: State, actor: int) -> bool:
    """Whether the next stop line on a vehicle's path has a light that is not green."""
    lines = [int(town.lanes.stop_line[lane]) for lane in state.path[actor].tolist() if lane >= 0]
    signals = [int(town.signals.stop_signal[line]) for line in lines if line >= 0][:1]
    return any(
        town.signals.kind[signal] == SignalKind.LIGHT and state.light[signal] != LightState.GREEN
        for signal in signals
    )


def drive(town: Town, seed: int) -> tuple[float, int]:
    """Ten minutes of traffic: (longest stand without a red [s], how often somebody left)."""
    world = World(town, WorldConfig(vehicles=VEHICLES, walkers=0))
    world.reset(seed, ())
    state, longest, left = world.view.state, 0, 0
    here = state.kind[:VEHICLES] != ActorKind.ABSENT
    red = [0] * VEHICLES  # when each last stood at one
    for _ in range(round(MINUTES * 60.0 / TICK_S / LOOK_TICKS)):
        world.advance(np.zeros((0, 3)), LOOK_TICKS)
        pair = overlapping_pair(
            state.kind, state.x, state.y, state.z, state.yaw, state.half_length, state.half_width
        )
        assert pair[0] < 0, f"{pair} overlap at {state.tick * TICK_S:.1f} s"
        tick, still = int(state.tick), state.still_ticks[:VEHICLES]
        assert still.max() * TICK_S <= STANDS_AT_REDS_S
        for actor in np.flatnonzero(still).tolist():
            if waits_at_red(town, state, actor):
                red[actor] = tick
            longest = max(longest, min(int(still[actor]), tick - red[actor]))
        now = state.kind[:VEHICLES] != ActorKind.ABSENT
        left += int((here & ~now).sum())
        here = now
    return longest * TICK_S, left


def check(folder: Path, seed: int) -> None:
    town = small_town(folder, seed)
    longest_s, left = drive(town, seed)
    assert longest_s <= STANDS_S
    assert left > 20  # or little has moved


@pytest.mark.filterwarnings("ignore:expected room for")
@pytest.mark.parametrize("seed", range(8))
def test_in_a_small_town_nobody_stands_for_two_minutes(tmp_path: Path, seed: int) -> None:
    check(tmp_path, seed)


@pytest.mark.filterwarnings("ignore:expected room for")
@pytest.mark.parametrize("seed", range(8, 200))
def test_in_many_small_towns_nobody_stands_for_two_minutes(tmp_path: Path, seed: int) -> None:
    check(tmp_path, seed)


def test_small_towns_are_of_all_sorts(tmp_path: Path) -> None:
    towns = [small_town(tmp_path, seed) for seed in range(40)]
    arms, lanes_a_side, shortest = set(), set(), []
    for town in towns:
        lanes = town.lanes
        roads = (lanes.kind == LaneKind.DRIVING) & (lanes.junction < 0)
        shortest.append(lanes.length_m[roads].min())
        lanes_a_side |= set(np.abs(lanes.lane_id[roads]).tolist())
        for junction in range(len(town.junction_names)):
            inside = np.flatnonzero(lanes.junction == junction)
            ends = [lanes.road[lanes.successor[lanes.successor_start[k]]] for k in inside]
            arms.add(len(set(map(int, ends))))
    assert arms == {2, 3, 4, 5, 6}
    assert lanes_a_side == {1, 2, 3}
    assert min(shortest) < 2.0


@pytest.mark.filterwarnings("ignore:expected room for")
def test_the_same_seed_drives_the_same_small_town_to_the_bit(tmp_path: Path) -> None:
    town = small_town(tmp_path, 4)
    records = []
    for _ in range(2):
        world = World(town, WorldConfig(vehicles=VEHICLES, walkers=0))
        world.reset(4, ())
        world.run(6000)
        records.append(world.save().record.tobytes())
    assert records[0] == records[1]


def test_where_fewer_fit_than_asked_for_a_warning_gives_the_numbers(tmp_path: Path) -> None:
    world = World(small_town(tmp_path, 0), WorldConfig(vehicles=500, walkers=0))
    with pytest.warns(UserWarning, match=r"room for 500 vehicles, but the town has (\d+) free"):
        world.reset(0, ())
    assert 0 < (world.view.state.kind[:500] != ActorKind.ABSENT).sum() < 500


def with_ego(town: Town, seed: int, nose_m: float) -> World:
    """A world whose ego stands for ever, its nose so far beyond the line of a junction."""
    lanes = town.lanes
    entry = int(traffic_tables(town).entry_lane[0])
    way = int(lanes.successor[lanes.successor_start[entry]])
    places = [pose_at(lanes, entry, 6.0), pose_at(lanes, way, float(lanes.length_m[way]) - 1.0)]
    points = np.array([place[:3] for place in places])
    plan = plan_route(town, points, route_id="0", graph=build_road_graph(town))
    world = World(town, WorldConfig(vehicles=VEHICLES, walkers=0))
    world.reset(seed, [plan])
    snapshot = world.save()
    state = views_of(snapshot.record)
    station = float(lanes.length_m[entry]) + nose_m - float(state.half_length[0])
    state.x[0], state.y[0], state.z[0], state.yaw[0] = pose_at(lanes, entry, station)
    locate_ego(state, lanes, 0)
    near = np.hypot(state.x[1:] - state.x[0], state.y[1:] - state.y[0]) < 15.0
    state.kind[1:][near] = ActorKind.ABSENT
    world.restore(snapshot)
    return world


@pytest.mark.filterwarnings("ignore:expected room for")
@pytest.mark.parametrize("nose_m", [-1.0, 2.0])
@pytest.mark.parametrize("seed", [0, 6, 8])
def test_an_ego_that_stands_for_ever_stops_only_those_whose_way_it_is_in(
    tmp_path: Path, seed: int, nose_m: float
) -> None:
    world = with_ego(small_town(tmp_path, seed), seed, nose_m)
    state, stand = world.view.state, np.array([[0.0, 0.0, 1.0]])
    passed = 0
    for _ in range(600):
        before = state.lane[1 : 1 + VEHICLES].copy()
        world.advance(stand, 20)
        now = state.lane[1 : 1 + VEHICLES]
        inside = (now >= 0) & (world.town.lanes.junction[now] >= 0)
        if state.tick > 6000:
            passed += int((inside & (now != before)).sum())
    assert passed > 20


@pytest.mark.filterwarnings("ignore:expected room for")
def test_nobody_comes_back_where_an_ego_might_see_it(tmp_path: Path) -> None:
    world = with_ego(small_town(tmp_path, 8), 8, -1.0)
    state, stand = world.view.state, np.array([[0.0, 0.0, 1.0]])
    back = []
    for _ in range(6000):
        away = state.away[1 : 1 + VEHICLES] != 0
        world.advance(stand)
        for actor in (1 + np.flatnonzero(away & (state.away[1 : 1 + VEHICLES] == 0))).tolist():
            back.append(math.dist((state.x[actor], state.y[actor]), (state.x[0], state.y[0])))
    assert len(back) > 5
    assert min(back) >= 60.0
