"""What is visible from the expert's car, and that it decides from nothing else."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from agents.expert.agent import Expert
from agents.expert.occlusion import Buildings, buildings_of
from agents.expert.visible import RANGE_M, Visible, empty_visible, see
from di_envs.suites import choose_suite
from di_envs.town.loading import load_town
from di_envs.town.town import Town
from di_envs.world.state import ActorKind, State, views_of
from di_envs.world.world import World, WorldConfig
from tests.agents.expert.scrambling import scrambled

NOWHERE = Buildings(*(np.zeros(0) for _ in Buildings._fields))


@pytest.fixture(scope="module")
def toy() -> Town:
    return load_town("toy")


def a_world(town: Town, others: int) -> World:
    """A world with an ego at the origin, and others far away until they are put somewhere."""
    suite = choose_suite("toy")
    world = World(town, WorldConfig(vehicles=others, walkers=0))
    world.reset(0, [suite.plans(town)[0]])
    return world


def changed(world: World) -> tuple[NDArray[np.void], State]:
    """A copy of a world's record and its named views, with nobody in it."""
    record = np.atleast_1d(world.save().record.copy())
    state = views_of(record)
    state.kind[:] = ActorKind.ABSENT
    return record, state


def put(state: State, actor: int, kind: ActorKind, x: float, y: float, size: float = 2.3) -> None:
    """Somebody who heads east; vans are 2.4 m high, all others 1.5 m."""
    state.kind[actor], state.x[actor], state.y[actor], state.z[actor] = kind, x, y, 0.0
    state.yaw[actor], state.speed[actor] = 0.0, 0.0
    state.half_length[actor], state.half_width[actor] = size, min(size, 1.0)
    state.height[actor] = 2.4 if kind == ActorKind.VAN else 1.5


def look(town: Town, state: State, buildings: Buildings = NOWHERE) -> Visible:
    """What the first ego sees."""
    visible = empty_visible(state.kind.size, state.light.size)
    see(state, town.lanes, town.signals, buildings, 0, False, visible)
    return visible


def kinds_seen(visible: Visible) -> list[ActorKind]:
    """Whom it sees, without poles."""
    kinds = [ActorKind(int(kind)) for kind in visible.kind[1 : visible.seen[0]]]
    return [kind for kind in kinds if kind != ActorKind.PROP]


@pytest.mark.parametrize(("hider", "hidden"), [(ActorKind.VAN, True), (ActorKind.CAR, False)])
def test_a_van_hides_a_walker_behind_it_and_a_car_does_not(
    toy: Town, hider: ActorKind, hidden: bool
):
    """From 1.6 m, over a roof at 1.5 m, his head is seen; over one at 2.4 m it is not."""
    _, state = changed(a_world(toy, 2))
    put(state, 0, ActorKind.CAR, 0.0, 0.0)
    put(state, 1, hider, 20.0, 0.0)
    put(state, 2, ActorKind.WALKER, 25.0, 0.0, 0.25)
    state.height[2] = 1.8
    assert kinds_seen(look(toy, state)) == ([hider] if hidden else [hider, ActorKind.WALKER])


def test_who_looks_out_beside_what_hides_him_is_seen(toy: Town):
    """The van's edge at y = 1, 22.3 m ahead, hides up to y = 1.12 at 25 m; his side is at 1.2."""
    _, state = changed(a_world(toy, 2))
    put(state, 0, ActorKind.CAR, 0.0, 0.0)
    put(state, 1, ActorKind.VAN, 20.0, 0.0)
    for y, seen in ((0.7, False), (1.6, True)):
        put(state, 2, ActorKind.WALKER, 25.0, y, 0.25)
        state.height[2] = 1.8
        assert (ActorKind.WALKER in kinds_seen(look(toy, state))) == seen


def test_a_building_hides_who_is_behind_it(toy: Town):
    _, state = changed(a_world(toy, 1))
    put(state, 0, ActorKind.CAR, 0.0, 0.0)
    put(state, 1, ActorKind.VAN, 40.0, 0.0)
    columns = (20.0, 0.0, 0.3, 5.0, 5.0, 9.0)  # x, y, yaw, half length, half width, top
    house = Buildings(*(np.array([value]) for value in columns))
    assert kinds_seen(look(toy, state)) == [ActorKind.VAN]
    assert kinds_seen(look(toy, state, house)) == []
    state.y[1] = 30.0  # at 37 degrees from the car, the house within 17
    assert kinds_seen(look(toy, state, house)) == [ActorKind.VAN]


def test_nobody_is_seen_further_away_than_the_range(toy: Town):
    _, state = changed(a_world(toy, 1))
    put(state, 0, ActorKind.CAR, 0.0, 0.0)
    for x, count in ((RANGE_M - 1.0, 1), (RANGE_M + 1.0, 0)):
        put(state, 1, ActorKind.CAR, x, 0.0)
        assert len(kinds_seen(look(toy, state))) == count


def test_a_town_has_buildings_that_stand_on_no_lane():
    town = load_town("town05")
    buildings = buildings_of(town)
    assert buildings.x.size > 50
    lanes = town.lanes
    for row in range(buildings.x.size):
        dx, dy = lanes.points[:, 0] - buildings.x[row], lanes.points[:, 1] - buildings.y[row]
        cos, sin = math.cos(buildings.yaw[row]), math.sin(buildings.yaw[row])
        along, across = np.abs(cos * dx + sin * dy), np.abs(cos * dy - sin * dx)
        inside = (along < buildings.half_length[row]) & (across < buildings.half_width[row])
        level = lanes.points[:, 2] < buildings.top_m[row]
        assert not (inside & level & (lanes.kind == 1)[lanes.point_lane]).any()


@pytest.mark.parametrize(
    ("suite_name", "scenarios", "route"), [("toy", "toy", 0), ("town05_short", "town05", 3)]
)
def test_at_every_tick_of_a_drive_it_decides_the_same_whatever_it_does_not_see(
    suite_name: str, scenarios: str, route: int
):
    suite = choose_suite(suite_name, scenarios=scenarios)
    town = load_town(suite.town_path)
    plan = suite.plans(town)[route]
    many = 12 if suite_name == "toy" else 120
    world = World(town, WorldConfig(vehicles=many, walkers=many // 2))
    world.reset(5, [plan])
    agent, random = Expert(), np.random.default_rng(3)
    memory, buildings, compared, hid = agent.start(plan, 5), buildings_of(town), 0, 0
    while not world.view.state.finished[0]:
        other = scrambled(world.view, buildings, random)
        hid += int((other.state.kind != world.view.state.kind).sum())
        got, left = agent.act({"world": other}, memory)
        control, memory = agent.act({"world": world.view}, memory)
        assert got.tolist() == control.tolist()
        assert left.progress == memory.progress
        world.advance(control[None].astype(np.float64), 1)
        compared += 1
    assert compared > 200
    assert hid > 0
