"""A world is a value: saved, restored and branched at any tick with the same bits."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from di_envs.observer import Observer
from di_envs.suites import load_suite
from di_envs.town.loading import load_town
from di_envs.town.plan import RoutePlan
from di_envs.world.state import TICK_S, ActorKind, EventKind, views_of
from di_envs.world.world import Snapshot, World, WorldConfig
from tests.di_envs.world.toy_scene import EAST_TO_1, MIDDLE_TO_2, WEST_TO_2_RIGHT, ToyScene

SUITE = load_suite("toy")
GO = np.array([[0.6, 0.0, 0.0]])
STAND = np.array([[0.0, 0.0, 1.0]])


def plan(route_id: str = "1") -> RoutePlan:
    return SUITE.plans(load_town("toy"), [route_id])[0]


def toy_world(seed: int = 0, vehicles: int = 8, walkers: int = 6) -> World:
    world = World(load_town("toy"), WorldConfig(vehicles=vehicles, walkers=walkers))
    world.reset(seed, [plan()])
    return world


def bits(world: World) -> bytes:
    return world.save().record.tobytes()


def drive(world: World, ticks: Iterable[int]) -> list[bytes]:
    """The bits after each tick, with pedals and wheel that depend on the tick alone."""
    seen = []
    for tick in ticks:
        world.advance(np.array([[0.5, 0.3 * np.sin(0.1 * tick), 0.2 * (tick % 7 == 0)]]))
        seen.append(bits(world))
    return seen


@pytest.mark.parametrize("tick", [0, 1, 37, 200, 399])
def test_a_restored_world_goes_on_with_the_same_bits_wherever_it_was_saved(tick):
    world, other = toy_world(), toy_world(seed=9)
    drive(world, range(tick))
    snapshot = world.save()
    first = drive(world, range(tick, tick + 100))
    world.restore(snapshot)
    assert drive(world, range(tick, tick + 100)) == first
    other.restore(snapshot)  # another world, in the middle of another episode
    assert drive(other, range(tick, tick + 100)) == first
    assert snapshot.record.tobytes() not in first  # and the snapshot was not driven on


def test_equal_seeds_give_equal_bits_and_others_other_ones():
    assert bits(toy_world(seed=3)) == bits(toy_world(seed=3))
    assert bits(toy_world(seed=3)) != bits(toy_world(seed=4))


def test_an_episode_does_not_depend_on_the_one_before():
    fresh, used = toy_world(), toy_world(seed=5)
    drive(used, range(150))
    used.reset(0, [plan()])
    assert drive(used, range(50)) == drive(fresh, range(50))


def test_many_ticks_at_once_are_as_many_single_ticks():
    """250 ticks: more than the event rows of one batch hold."""
    one, many = toy_world(), toy_world()
    events = [event for _ in range(250) for event in one.advance(GO)]
    assert many.advance(GO, 250) == events
    assert bits(one) == bits(many)


def test_a_snapshot_of_another_town_is_refused():
    world = toy_world()
    other = World(load_town("town05"), WorldConfig(vehicles=8, walkers=6))
    with pytest.raises(ValueError, match="load the town that it was saved in"):
        other.restore(world.save())


@pytest.mark.parametrize("counts", [(7, 6), (8, 7)])
def test_a_snapshot_of_another_layout_is_refused(counts):
    world = World(load_town("toy"), WorldConfig(vehicles=counts[0], walkers=counts[1]))
    with pytest.raises(ValueError, match="same numbers of actors"):
        world.restore(toy_world().save())


def test_a_snapshot_of_another_version_is_refused():
    world = toy_world()
    saved = world.save()
    old = Snapshot(
        town_hash=saved.town_hash,
        version="0",
        capacity=saved.capacity,
        record=saved.record,
        plans=saved.plans,
    )
    with pytest.raises(ValueError, match="layout 0"):
        world.restore(old)


def without(world: World, actor: int) -> World:
    """The same world with one actor taken away."""
    snapshot = world.save()
    views_of(snapshot.record).kind[actor] = ActorKind.ABSENT
    world.restore(snapshot)
    return world


def tracks(world: World, ticks: int) -> np.ndarray:
    """(ticks, A, 3) x, y and the next lane chosen of everybody."""
    state, rows = world.view.state, []
    for _ in range(ticks):
        world.advance(STAND)
        rows.append(np.stack((state.x, state.y, state.path[:, -1])).T)
    return np.array(rows)


def test_removing_a_walker_changes_the_way_of_nobody_who_did_not_meet_him():
    config = WorldConfig(vehicles=0, walkers=60)
    worlds = [World(load_town("town05"), config) for _ in range(2)]
    for world in worlds:
        world.reset(0, ())
    state = worlds[0].view.state
    removed = int(np.flatnonzero(state.kind == ActorKind.WALKER)[0])
    without(worlds[1], removed)
    none = np.zeros((0, 3))
    met = np.zeros(state.kind.size, bool)
    for _ in range(round(60.0 / TICK_S)):
        for world in worlds:
            world.advance(none)
        near = np.hypot(state.x - state.x[removed], state.y - state.y[removed]) < 20.0
        met |= near
    other = worlds[1].view.state
    assert (~met).sum() > 40
    for values, others in ((state.x, other.x), (state.y, other.y), (state.walk_m, other.walk_m)):
        assert np.array_equal(values[~met], others[~met])


def test_removing_a_vehicle_changes_no_turn_that_another_takes():
    """Three vehicles far from each other; each chooses its lanes from its own keys."""
    ways = []
    for removed in (None, 1, 2):
        scene = ToyScene(vehicles=3)
        scene.put(0, [WEST_TO_2_RIGHT], 60.0, speed=10.0)
        scene.put(1, [EAST_TO_1], 200.0)
        scene.put(2, [MIDDLE_TO_2], 50.0)
        if removed is not None:
            without(scene.world, removed)
        ways.append([state.path[0].tolist() for state in scene.run(5.0)])
    assert ways[0] == ways[1] == ways[2]


def test_what_may_be_seen_cannot_be_changed():
    view = toy_world().view
    with pytest.raises(ValueError, match="read-only"):
        view.state.x[0] = 0.0


def test_a_world_without_an_episode_says_so():
    with pytest.raises(RuntimeError, match="call reset"):
        World(load_town("toy")).view  # noqa: B018 (the property raises)


@pytest.mark.parametrize("name", ["vehicles", "walkers"])
def test_negative_numbers_of_actors_are_refused(name):
    with pytest.raises(ValueError, match=f"{name} must not be negative, got -1"):
        WorldConfig(**{name: -1})


def test_of_more_vehicles_than_the_town_has_places_for_those_drive_that_fit():
    with pytest.warns(
        UserWarning, match=r"room for 1000 vehicles.* free places: \d+ drive"
    ) as told:
        world = toy_world(vehicles=1000)
    places = int(str(told[0].message).split("free places: ")[1].split()[0])
    kinds = world.view.state.kind[1:]
    driving = (kinds != ActorKind.ABSENT) & (kinds < ActorKind.WALKER)
    assert driving.sum() == places == toy_world(vehicles=places).view.capacity.vehicles


def test_an_ego_that_leaves_the_road_hits_the_pole_of_a_light():
    """The first light's pole stands at (-15.1, -42.2), 0.8 m beside the street."""
    world = toy_world(vehicles=0, walkers=0)
    pole = 1  # after the ego, as there is nobody else
    pose = world.town.signals.pose[0]
    snapshot = world.save()
    state = views_of(snapshot.record)
    state.x[0], state.y[0], state.yaw[0] = pose[0] - 10.0, pose[1], 0.0
    world.restore(snapshot)
    events = world.advance(GO, 100)
    hits = [event for event in events if event.kind == EventKind.COLLISION_STATIC]
    assert [(hit.ego, hit.other) for hit in hits] == [(0, pole)]
    now = world.view.state
    assert now.x[0] == pytest.approx(pose[0] - 0.15 - now.half_length[0], abs=0.05)
    assert (now.x[pole], now.y[pole]) == tuple(pose[:2])


def test_there_is_a_pole_for_each_signal_and_it_stands_beside_the_lanes():
    world = toy_world()
    state = world.view.state
    poles = np.flatnonzero(state.kind == ActorKind.PROP)
    assert poles.size == world.town.signals.kind.size == 4
    assert state.height[poles].tolist() == [5.0, 5.0, 5.0, 3.0]  # three lights, one stop sign


def test_poles_are_no_obstacles_in_the_prompt_as_they_would_give_the_signals_away():
    world = toy_world(vehicles=0, walkers=0)
    observer = Observer(world.town, ("prompt",))
    observer.start(world.view)
    assert not observer.observe()["obstacles"].any()
