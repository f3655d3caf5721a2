"""Towns and scenes as highway-env objects, checked by highway-env's own geometry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import di_envs
from di_envs.highway.conversion import lane_indices, to_highway_road, to_lane, to_road_network
from di_envs.town.lanes import LaneKind
from di_envs.town.loading import load_town
from di_envs.town.routing.router import plan_route
from di_envs.town.routing.routes import read_routes
from di_envs.town.town import Town
from di_envs.world.state import ActorKind
from di_envs.world.world import World, WorldConfig

ROUTES = Path(di_envs.__file__).parent / "town" / "data" / "routes" / "toy.xml"


@pytest.fixture(scope="module", params=["toy", "town05"])
def town(request: pytest.FixtureRequest) -> Town:
    return load_town(request.param)


def driving_lanes(town: Town) -> list[int]:
    return np.flatnonzero(town.lanes.kind == LaneKind.DRIVING).tolist()


def test_every_driving_lane_has_a_name_of_its_own(town: Town):
    names = lane_indices(town)
    assert sorted(names) == driving_lanes(town)
    assert len(set(names.values())) == len(names)
    assert len(to_road_network(town).lanes_list()) == len(names)


def test_linked_lanes_meet_at_a_node(town: Town):
    names, lanes = lane_indices(town), town.lanes
    for lane in driving_lanes(town):
        for k in range(lanes.successor_start[lane], lanes.successor_start[lane + 1]):
            assert names[int(lanes.successor[k])][0] == names[lane][1]


def test_neighbours_are_numbered_from_the_left(town: Town):
    names, lanes = lane_indices(town), town.lanes
    for lane in driving_lanes(town):
        right = int(lanes.right[lane])
        if right >= 0:
            assert names[right][:2] == names[lane][:2]
            assert names[right][2] > names[lane][2]


def test_lanes_lie_where_ours_do(town: Town):
    lanes = town.lanes
    for lane in driving_lanes(town)[::5]:
        theirs = to_lane(lanes, lane)
        assert theirs.length == pytest.approx(lanes.length_m[lane], rel=0.01, abs=0.05)
        for share in (0.0, 0.3, 0.8):
            point = lanes.first[lane] + round(share * (lanes.count[lane] - 1))
            along, across = theirs.local_coordinates(lanes.points[point, :2])
            assert abs(across) < 0.06
            station = (point - lanes.first[lane]) * lanes.spacing_m[lane]
            assert along == pytest.approx(station, abs=0.3)


def test_a_part_of_a_network_keeps_its_names(town: Town):
    names = lane_indices(town)
    some = driving_lanes(town)[:3]
    part = to_road_network(town, some)
    for lane in some:
        position = part.get_lane(names[lane]).position(0.0, 0.0)
        start = town.lanes.points[town.lanes.first[lane], :2]
        assert np.hypot(*(position - start)) < 0.05


def test_a_scene_has_every_vehicle_and_walker_where_it_is():
    town = load_town("toy")
    route = read_routes(ROUTES)[0]
    world = World(town, WorldConfig(vehicles=6, walkers=4))
    world.reset(0, [plan_route(town, route.positions)])
    world.advance(np.zeros((1, 3)), 40)
    state = world.view.state
    road = to_highway_road(world.view)
    vehicles = [a for a in range(state.kind.size) if 1 <= state.kind[a] < ActorKind.WALKER]
    assert len(road.vehicles) == len(vehicles) == 7
    for actor, vehicle in zip(vehicles, road.vehicles, strict=True):
        assert vehicle.position.tolist() == [state.x[actor], state.y[actor]]
        assert vehicle.speed == state.speed[actor]
        assert pytest.approx(2.0 * state.half_length[actor]) == vehicle.LENGTH
        assert vehicle.lane.distance(vehicle.position) < 4.0
    walkers = np.count_nonzero(state.kind == ActorKind.WALKER)
    assert len(road.objects) == walkers > 0
    before = [vehicle.position.copy() for vehicle in road.vehicles]
    for _ in range(5):  # highway-env can take it from here
        road.act()
        road.step(0.1)
    moved = [np.hypot(*(v.position - b)) for v, b in zip(road.vehicles, before, strict=True)]
    assert max(moved) > 0.5
    assert np.isfinite(moved).all()
