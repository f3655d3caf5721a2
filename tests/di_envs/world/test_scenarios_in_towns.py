"""Scenarios among traffic: who else is there brakes, obeys the lights it sees, and gets on."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from agents import load_agent
from di_envs.numerics.geometry import boxes_overlap
from di_envs.suites import load_suite
from di_envs.town.loading import load_town
from di_envs.town.plan import RoutePlan, ScenarioTrigger
from di_envs.town.queries import nearest_driving_lane_towards
from di_envs.world.scenarios.tables import AHEAD, DONE
from di_envs.world.state import ActorKind, EventKind, State
from di_envs.world.world import World, WorldConfig
from tests.di_envs.world.test_traffic_soak import overlapping_pair
from tests.di_envs.world.toy_scene import ToyScene

STANDING = np.array([[0.0, 0.0, 1.0]])


def town05_plan(route: int, scenarios: str) -> RoutePlan:
    suite = load_suite("town05_long")
    plan = suite.plans(load_town("town05"))[route]
    return plan if scenarios == "shipped" else dataclasses.replace(plan, scenarios=())


def common_part(state: State, actors: int) -> dict[str, bytes]:
    """Every field, without the slots of scenarios and what only triggers have."""
    longer = state.kind.size
    return {
        name: (
            field[:, :actors]
            if name in ("contact_tick", "hit")  # by ego and actor
            else field[:actors]
            if field.ndim and field.shape[0] == longer
            else field
        ).tobytes()
        for name, field in zip(state._fields, state, strict=True)
        if name not in ("nearest_index", "scenario_step", "scenario_tick", "scenario_m")
    }


def test_triggers_that_nobody_reaches_change_no_bit():
    town, bits = load_town("town05"), []
    plan = town05_plan(0, "none")
    far = tuple(ScenarioTrigger(type=t, subtype="", point=1500) for t in (1, 3, 7))
    for scenarios in ((), far):
        world = World(town, WorldConfig(vehicles=40, walkers=20))
        world.reset(3, (dataclasses.replace(plan, scenarios=scenarios),))
        world.advance(np.array([[0.5, 0.0, 0.0]]), 400)
        bits.append(common_part(world.view.state, 1 + 40 + 20 + town.signals.kind.size))
    assert bits[0] == bits[1]


@pytest.mark.parametrize("speed", [6.0, 9.0, 12.0])
def test_oncoming_traffic_brakes_for_somebody_who_crosses_and_then_goes_on(speed):
    plan, trigger = next(  # on a straight street, away from junctions
        (plan, point)
        for plan in load_suite("toy").plans(load_town("toy"))
        for point in range(5, plan.lane.size - 25)
        if np.ptp(plan.lane[point - 5 : point + 25]) == 0
        and np.ptp(plan.points[point - 5 : point + 25, 3]) < 0.01
    )
    somebody = ScenarioTrigger(type=3, subtype="", point=trigger)
    scene = ToyScene(plans=(dataclasses.replace(plan, scenarios=(somebody,)),))
    lanes, slot = scene.town.lanes, scene.world.view.capacity.first_scenario_actor
    with scene.edit() as state:
        state.x[0], state.y[0], state.z[0], state.yaw[0] = plan.points[trigger]
        state.nearest_index[0] = state.route_index[0] = trigger
    next(scene.run(0.05))
    x, y, z, yaw = (float(field[slot]) for field in (scene.state.x, scene.state.y, scene.state.z,
                                                     scene.state.yaw))  # fmt: skip
    assert scene.state.kind[slot] == ActorKind.WALKER
    road_yaw = yaw + 0.5 * np.pi
    across = x + 12.0 * np.cos(yaw), y + 12.0 * np.sin(yaw)
    lane, station, _, _ = nearest_driving_lane_towards(lanes, *across, z, road_yaw + np.pi, 10.0)
    scene.put(1, [int(lane)], lanes.length_m[lane] - station + 30.0, speed=speed)
    speeds, begun = [], False
    for state in scene.run(20.0):
        begun = begun or state.scenario_step[0] > 1
        speeds.append(float(state.speed[1]))
        assert not boxes_overlap(
            *(float(f[1]) for f in (state.x, state.y, state.yaw)), 2.0, 0.9,
            *(float(f[slot]) for f in (state.x, state.y, state.yaw)), 0.25, 0.25,
        )  # fmt: skip
    assert begun
    assert scene.state.scenario_step[0] == DONE
    assert min(speeds[:200]) < 0.7 * speed
    assert max(speeds[200:]) > 5.0


def drive_town05(route: int, seed: int) -> tuple[World, list, list[tuple[int, int]]]:
    """The expert drives a route with its shipped scenarios; notes who overlaps whom."""
    town, plan = load_town("town05"), town05_plan(route, "shipped")
    world = World(town, WorldConfig())
    world.reset(seed, (plan,))
    agent = load_agent("expert")
    memory = agent.start(plan, seed)
    events, overlaps = [], []
    state = world.view.state
    while not state.finished[0]:
        control, memory = agent.act({"world": world.view}, memory)
        events += world.advance(control[None].astype(np.float64), 2)
        vehicles = slice(1, 121)
        pair = overlapping_pair(
            state.kind[vehicles], state.x[vehicles], state.y[vehicles], state.z[vehicles],
            state.yaw[vehicles], state.half_length[vehicles], state.half_width[vehicles],
        )  # fmt: skip
        if pair[0] >= 0:
            overlaps.append(pair)
        assert np.isfinite(state.x).all()
        assert np.isfinite(state.speed).all()
    return world, events, overlaps


@pytest.mark.parametrize(("route", "seed"), [(9, 0), (8, 1)])
def test_a_drive_through_all_scenarios_leaves_traffic_whole_and_moving(route, seed):
    world, events, overlaps = drive_town05(route, seed)
    state, plan = world.view.state, world.view.plans[0]
    begun = [event for event in events if event.kind == EventKind.SCENARIO]
    print(f"{len(begun)} of {len(plan.scenarios)} triggers, types {[int(e.value) for e in begun]}")
    assert overlaps == []
    assert state.finished[0] == EventKind.COMPLETED
    assert len(begun) >= 0.9 * len(plan.scenarios)
    assert [plan.scenarios[event.other].type for event in begun] == [int(e.value) for e in begun]
    # an ego whose route has ended leaves nothing behind, and traffic goes on
    world.advance(STANDING, 1)
    assert set(state.scenario_step.tolist()) <= {AHEAD, DONE}
    assert (state.held_by == 0).all()
    assert (state.forced_light == 0).all()
    slots = state.kind[world.view.capacity.first_scenario_actor :]
    assert (slots == ActorKind.ABSENT).all()
    world.remove_actor(0)
    world.advance(STANDING, 4000)
    assert int(state.still_ticks[1:121].max()) * 0.05 < 120.0
