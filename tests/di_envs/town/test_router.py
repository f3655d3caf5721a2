"""The router: equal to CARLA's planner on Town05, by hand on the toy town, and what it refuses."""

from __future__ import annotations

import json
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from di_envs.town.building.ways import lane_changes
from di_envs.town.lanes import LaneKind
from di_envs.town.loading import load_town
from di_envs.town.plan import RoadOption, RoutePlan
from di_envs.town.routing.pieces import cut_lanes
from di_envs.town.routing.road_graph import RoadGraph, build_road_graph
from di_envs.town.routing.router import RouteError, plan_route, target_indices
from di_envs.town.routing.routes import read_routes
from tests.carla_wheel import carla_wheel

LANEFOLLOW, CHANGE_LEFT = int(RoadOption.LANEFOLLOW), int(RoadOption.CHANGELANELEFT)


@pytest.fixture(scope="module")
def toy() -> RoadGraph:
    return build_road_graph(load_town("toy"))


@pytest.fixture(scope="module")
def town05(shared: Path) -> RoadGraph:
    return build_road_graph(load_town(shared / "data/xodr/Town05.xodr", signals="town05"))


@pytest.fixture(scope="module")
def long_plans(shared: Path, town05: RoadGraph) -> dict[str, RoutePlan]:
    return plans_of(town05, shared / "data/routes/routes_town05_long.xml")


def plans_of(graph: RoadGraph, path: Path) -> dict[str, RoutePlan]:
    return {
        spec.route_id: plan_route(graph.town, spec.positions, route_id=spec.route_id, graph=graph)
        for spec in read_routes(path)
    }


# -- against what CARLA's own planner made ---------------------------------------------------------


def test_the_long_routes_are_carlas_point_by_point(
    shared: Path, long_plans: dict[str, RoutePlan]
) -> None:
    oracle = json.loads((shared / "data/town05_long_routes_1m.json").read_text())["routes"]
    assert len(oracle) == len(long_plans) == 10
    for name, rows in oracle.items():
        plan = long_plans[name.removeprefix("long_")]
        assert len(plan.points) == len(rows), name
        points = np.array([row[:3] for row in rows])
        # 2 cm: CARLA evaluates the curves, we interpolate between points 0.5 m apart
        assert np.linalg.norm(plan.points[:, :3] - points, axis=1).max() < 0.02, name
        yaw = np.degrees(plan.points[:, 3]) - [row[3] for row in rows]
        assert np.abs((yaw + 180.0) % 360.0 - 180.0).max() < 3.0, name
        assert [RoadOption(option).name for option in plan.option] == [row[4] for row in rows]


def test_the_long_routes_targets_are_carlas_to_one_point(
    shared: Path, long_plans: dict[str, RoutePlan]
) -> None:
    """Where 50 steps of 1 m make 50 m, single precision decides in CARLA: one point either way."""
    oracle = json.loads((shared / "data/town05_long_routes_1m.json").read_text())["routes"]
    away = []
    for name, rows in oracle.items():
        expected = np.flatnonzero([row[8] for row in rows])
        targets = long_plans[name.removeprefix("long_")].targets
        assert len(targets) == len(expected), name
        away += np.abs(targets - expected).tolist()
    assert max(away) <= 1
    assert np.mean(np.array(away) == 0) > 0.9


def test_the_short_routes_have_carlas_lengths_points_targets_and_timeouts(
    shared: Path, town05: RoadGraph
) -> None:
    """Their keypoints lie up to 58 m beside the road; figures from the facts on the routes."""
    text = (shared / "facts/route_facts.md").read_text().split("## Short")[1]
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in text.splitlines()
        if re.match(r"\| \d+ \|", line)
    ]
    plans = plans_of(town05, shared / "data/routes/routes_town05_short.xml")
    assert len(rows) == len(plans) == 32
    for row in rows:
        plan = plans[row[0]]
        assert abs(plan.length_m - float(row[3])) < 0.55
        assert len(plan.points) == int(row[4])
        assert lane_changes(plan) == int(row[8])
        assert len(plan.targets) == int(row[11])
        assert plan.timeout_s == float(row[12])


def test_keypoints_are_put_where_carla_puts_them(shared: Path, town05: RoadGraph) -> None:
    carla = carla_wheel()
    carla_map = carla.Map("Town05", (shared / "data/xodr/Town05.xodr").read_text())
    for name in ("long", "short"):
        for spec in read_routes(shared / f"data/routes/routes_town05_{name}.xml"):
            for position in spec.positions:
                snap = town05.snap(position)
                place = carla_map.get_waypoint(carla.Location(*position))
                expected = place.transform.location
                found = snap.place.points[0, :3]
                away = np.linalg.norm(found - [expected.x, expected.y, expected.z])
                assert away < 0.05, (spec.route_id, position)
                road = town05.town.lanes.road[snap.lane]
                assert town05.town.road_names[road] == str(place.road_id)


@pytest.mark.parametrize("name", ["Town05", "Town01_2020", "Town04_2020"])
def test_pieces_of_lanes_come_in_carlas_order(shared: Path, name: str) -> None:
    """The order settles ties between equally long ways; CARLA's is that of a C++ hash map."""
    carla = carla_wheel()
    path = shared / f"data/xodr/{name}.xodr"
    town = load_town(path, signals="synthesise")
    topology = carla.Map(name, path.read_text()).get_topology()
    theirs = dict.fromkeys((str(begin.road_id), begin.section_id) for begin, _ in topology)
    ours = dict.fromkeys(
        (town.road_names[town.lanes.road[piece.lane]], piece.section) for piece in cut_lanes(town)
    )
    # sections without length have no piece here; section ids of one road rise in both
    assert [key for key in theirs if key in ours] == list(ours)


# -- the toy town, by hand -------------------------------------------------------------------------


def test_a_straight_drive_of_ten_metres_is_points_a_metre_apart(toy: RoadGraph) -> None:
    # street 11's southern side, eastwards: y = 50 + 1.5 lanes of 3.5 m
    plan = plan_route(toy.town, [(-60.0, 55.25, 0.0), (-50.0, 55.25, 0.0)], graph=toy)
    assert set(plan.option) == {LANEFOLLOW}
    np.testing.assert_allclose(np.diff(plan.points[:, 0]), 1.0, atol=1e-6)
    np.testing.assert_allclose(plan.points[:, 1], 55.25, atol=1e-6)
    # points lie on whole metres from the lane's begin: the first within half a metre of the start,
    # the last the first that is less than 2 m before the end
    assert abs(plan.points[0, 0] - -60.0) <= 0.5
    assert -52.0 < plan.points[-1, 0] <= -51.0
    assert plan.length_m == pytest.approx(plan.points[-1, 0] - plan.points[0, 0])
    assert plan.timeout_s == int(0.8 * plan.length_m + 5.0)


def test_turning_off_at_the_light_is_commanded_right_until_the_junction_ends(
    toy: RoadGraph,
) -> None:
    # from the west into the middle street: the southbound arm is to the right
    plan = plan_route(toy.town, [(-45.0, -44.75, 0.0), (-1.75, 5.0, 0.0)], graph=toy)
    lanes = toy.town.lanes
    named = [RoadOption(option) for option in plan.option[np.diff(plan.option, prepend=-9) != 0]]
    assert named == [RoadOption.LANEFOLLOW, RoadOption.RIGHT, RoadOption.LANEFOLLOW]
    turning = np.flatnonzero(plan.option == RoadOption.RIGHT)
    assert (lanes.junction[plan.lane[turning[1:-1]]] >= 0).all()
    # a target where it starts, and one where it is over
    assert {0, int(turning[0]), int(turning[-1]) + 1} <= set(plan.targets.tolist())


def test_a_lane_change_jumps_to_the_lane_beside(toy: RoadGraph) -> None:
    lanes = toy.town.lanes
    # westwards north of the centre line; the outer lane is the right one
    plan = plan_route(toy.town, [(-40.0, -51.75, 0.0), (-75.0, -55.25, 0.0)], graph=toy)
    changing = np.flatnonzero(plan.option == RoadOption.CHANGELANERIGHT)
    assert changing.tolist() == [0, 1]
    assert lanes.right[plan.lane[0]] == plan.lane[1]
    assert plan.points[1, 1] - plan.points[0, 1] == pytest.approx(-3.5)


def test_every_point_lies_on_the_lane_and_station_that_it_names(
    town05: RoadGraph, long_plans: dict[str, RoutePlan]
) -> None:
    lanes = town05.town.lanes
    for plan in long_plans.values():
        assert (lanes.kind[plan.lane] == LaneKind.DRIVING).all()
        assert (plan.lane_m >= 0.0).all()
        assert (plan.lane_m <= lanes.length_m[plan.lane] + 1e-9).all()
        row = lanes.first[plan.lane] + np.rint(plan.lane_m / lanes.spacing_m[plan.lane])
        near = lanes.points[row.astype(int), :3] - plan.points[:, :3]
        # a quarter of a metre to the nearest lane point; a few points more where CARLA takes them
        # from a connector that begins or ends within the same metre
        away_m = np.linalg.norm(near, axis=1)
        assert away_m.max() < 0.7, plan.route_id
        assert (away_m > 0.26).sum() <= 6, plan.route_id
        # lanes follow one another by links or lie side by side
        for a, b in pairwise(plan.lane[np.append(True, np.diff(plan.lane) != 0)]):
            ahead = lanes.successor[lanes.successor_start[a] : lanes.successor_start[a + 1]]
            assert b in {*ahead, lanes.left[a], lanes.right[a]}, plan.route_id


def test_planning_twice_gives_equal_read_only_arrays(toy: RoadGraph) -> None:
    ends = [(-45.0, 51.75, 0.0), (1.75, -5.0, 0.0)]
    first, second = (plan_route(toy.town, ends, graph=toy) for _ in range(2))
    fresh = plan_route(toy.town, ends)
    for name in ("points", "option", "lane", "lane_m", "route_m", "targets"):
        array = getattr(first, name)
        np.testing.assert_array_equal(array, getattr(second, name))
        np.testing.assert_array_equal(array, getattr(fresh, name))
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


# -- target points ---------------------------------------------------------------------------------


def line(count: int) -> np.ndarray[Any, Any]:
    """`count` points a metre apart."""
    return np.stack([np.arange(count), np.zeros(count), np.zeros(count)], axis=1).astype(float)


def test_a_straight_route_has_a_target_after_each_fifty_metres() -> None:
    options = np.full(120, LANEFOLLOW, np.int8)
    # 0 is kept; 1 .. 51 add a metre each, so that at 52 more than 50 m have gone by
    assert target_indices(line(120), options).tolist() == [0, 52, 104, 119]


def test_lane_changes_are_all_kept_and_the_point_after_them_is_not() -> None:
    options = np.array([LANEFOLLOW] * 3 + [CHANGE_LEFT] * 2 + [LANEFOLLOW] * 3, np.int8)
    assert target_indices(line(8), options).tolist() == [0, 3, 4, 7]


@settings(max_examples=50, deadline=None)
@given(options=st.lists(st.sampled_from([1, 2, 3, 4, 5, 6]), min_size=2, max_size=200))
def test_targets_rise_begin_and_end_with_the_route_and_lie_close(options: list[int]) -> None:
    targets = target_indices(line(len(options)), np.array(options, np.int8))
    assert targets[0] == 0
    assert targets[-1] == len(options) - 1
    assert (np.diff(targets) > 0).all()
    assert np.diff(targets).max() <= 53


# -- what is refused -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keypoints", "message"),
    [
        ([(0.0, 0.0, 0.0)], "at least two keypoints"),
        ([(0.0, 0.0), (1.0, 0.0)], r"shape \(K, 3\)"),
        ([(0.0, 0.0, 0.0), (1.0, np.nan, 0.0)], "keypoint 1 is .*nan.*finite"),
        ([(0.0, 0.0, 0.0), (0.0, 200.0, 0.0)], "keypoint 1 at .*200.0.* from the nearest driving"),
    ],
)
def test_bad_keypoints_are_refused_by_number(
    toy: RoadGraph, keypoints: list[tuple[float, ...]], message: str
) -> None:
    with pytest.raises(RouteError, match=f"Route 'mine': .*{message}"):
        plan_route(toy.town, keypoints, route_id="mine", graph=toy)


def test_a_tighter_limit_refuses_keypoints_beside_the_road(toy: RoadGraph) -> None:
    keypoints = [(-60.0, 52.75, 0.0), (-50.0, 51.75, 0.0)]  # the first one a metre off
    plan_route(toy.town, keypoints, graph=toy, max_snap_m=1.1)
    with pytest.raises(RouteError, match=r"keypoint 0 .* is 1\.0 m .* at most 0\.9 m"):
        plan_route(toy.town, keypoints, graph=toy, max_snap_m=0.9)


TWO_ISLANDS = """<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="4"/>{roads}</OpenDRIVE>"""
ISLAND = """<road name="" length="50" id="{id}" junction="-1"><link/>
<planView><geometry s="0" x="0" y="{y}" hdg="0" length="50"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none" level="false"/></center>
<right><lane id="-1" type="driving" level="false"><link/>
<width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road>"""


@pytest.mark.filterwarnings("ignore:.*signal")
def test_lanes_without_a_way_between_them_are_named(tmp_path: Path) -> None:
    path = tmp_path / "islands.xodr"
    roads = "".join(ISLAND.format(id=i, y=20 * i) for i in (1, 2))
    path.write_text(TWO_ISLANDS.format(roads=roads))
    town = load_town(path)
    with pytest.raises(RouteError, match=r"no way leads from keypoint 0 .road 1 lane -1.*road 2"):
        plan_route(town, [(10.0, -18.25, 0.0), (40.0, -38.25, 0.0)])


def test_a_graph_of_another_town_is_refused(toy: RoadGraph) -> None:
    with pytest.raises(ValueError, match=r"graph was built of town 'toy'.*'town05'"):
        plan_route(load_town("town05"), [(0, 0, 0), (1, 0, 0)], graph=toy)


# -- what is odd, and said -------------------------------------------------------------------------

CASES = Path(__file__).parents[2] / "data" / "cases"


@pytest.mark.filterwarnings("ignore:.*signal")
def test_a_lane_change_beside_a_tiny_road_goes_ahead_as_carlas(tmp_path: Path) -> None:
    town = load_town(CASES / "short_road.xodr", cache_folder=tmp_path)
    (spec,) = read_routes(CASES / "short_road.xml")
    plan = plan_route(town, spec.positions)
    # from (120, 1.75) it goes to the lane beside, five metres on; then to the goal, less 2 m
    np.testing.assert_allclose(plan.points[:2, :2], [(120.0, 1.75), (125.0, 5.25)], atol=0.01)
    assert plan.length_m == pytest.approx(49.1, abs=0.1)
    assert plan.remarks == ()


def test_a_route_against_the_lane_is_refused_not_planned_to_no_length(toy: RoadGraph) -> None:
    # street 11's southern side leads east; half a metre, and a metre back
    for end in (-59.6, -61.0):
        with pytest.raises(RouteError, match=r"Route 'r' is 0\.0 m long.*nothing is left to drive"):
            plan_route(toy.town, [(-60.0, 55.25, 0.0), (end, 55.25, 0.0)], route_id="r", graph=toy)


def test_a_keypoint_beside_its_lane_and_too_high_is_named(toy: RoadGraph) -> None:
    plan = plan_route(toy.town, [(-60.0, 55.25, 0.0), (-20.0, 55.25, 6.0)], graph=toy)
    (remark,) = [remark.text for remark in plan.remarks if "lies" in remark.text]
    assert "keypoint 1" in remark
    assert "6.0 m from its lane, 6.0 m too high" in remark
