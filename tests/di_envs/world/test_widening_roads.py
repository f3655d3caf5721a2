"""Traffic where a lane begins beside another: at first it has no width, and lies over that one.

A road of one lane runs east for 100 m, and goes on for 200 m as two: the right one gains its width
of 3.5 m over 40 m.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from di_envs.town.queries import width_at
from di_envs.town.town import Town
from di_envs.world.state import ActorKind
from di_envs.world.traffic.tables import traffic_tables
from di_envs.world.world import World, WorldConfig
from tests.di_envs.town.small_maps import lane, load, opendrive, road, section
from tests.di_envs.world.test_traffic_soak import overlapping_pair

WIDENS = (
    '<width sOffset="0" a="0" b="0.0875" c="0" d="0"/>'
    '<width sOffset="40" a="3.5" b="0" c="0" d="0"/>'
)
VEHICLES = 12


@pytest.fixture
def town(tmp_path: Path) -> Town:
    sections = (
        section(0.0, lane(-1, successor=-1)),
        section(100.0, lane(-1, predecessor=-1), lane(-2, width=WIDENS)),
    )
    return load(opendrive(road("1", 300.0, *sections)), tmp_path)


def test_vehicles_come_back_where_the_road_begins_and_not_where_it_widens(town: Town):
    tables = traffic_tables(town)
    assert town.lanes.lane_id[tables.entry_lane].tolist() == [-1]
    assert tables.entry_pose[0, 0] < 10.0


@pytest.mark.filterwarnings("ignore:expected room for")
@pytest.mark.parametrize("seed", range(3))
def test_nobody_is_on_a_lane_narrower_than_himself_and_nobody_touches(town: Town, seed: int):
    world = World(town, WorldConfig(vehicles=VEHICLES, walkers=0))
    world.reset(seed, ())
    state, lanes, seen = world.view.state, town.lanes, 0
    for _ in range(300):
        for actor in np.flatnonzero(state.kind[:VEHICLES] != ActorKind.ABSENT).tolist():
            own = int(state.lane[actor])
            width = width_at(lanes, own, float(state.lane_m[actor]))
            assert width >= 2.0 * state.half_width[actor]
            seen += lanes.lane_id[own] == -2
        pair = overlapping_pair(
            state.kind, state.x, state.y, state.z, state.yaw, state.half_length, state.half_width
        )
        assert pair[0] < 0
        world.advance(np.zeros((0, 3)), 10)
    assert seen > 0
