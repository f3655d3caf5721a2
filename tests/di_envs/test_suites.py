"""Suites: the shipped ones keep what they promise; own files and bad names are handled."""

from __future__ import annotations

import dataclasses
import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from di_envs.suites import DATA, TrafficLevel, choose_suite, load_suite, read_suite, suite_names
from di_envs.town.building.routes import build_short, build_tiny, build_toy, lit_junctions
from di_envs.town.building.ways import lane_changes, lanes_driven, turns
from di_envs.town.lanes import SignalKind, Turn
from di_envs.town.loading import load_town
from di_envs.town.plan import RoutePlan
from di_envs.town.routing.road_graph import build_road_graph
from di_envs.town.routing.router import RouteError
from di_envs.town.routing.routes import read_routes
from di_envs.town.town import Town

Plans = dict[str, tuple[RoutePlan, ...]]


@pytest.fixture(scope="module")
def town05() -> Town:
    return load_town("town05")


@pytest.fixture(scope="module")
def plans(town05: Town) -> Plans:
    """All Town05 plans: that none raises is part of the promise."""
    names = ("town05_long", "town05_short", "town05_tiny")
    return {name: load_suite(name).plans(town05) for name in names}


def lights_met(town: Town, plan: RoutePlan) -> int:
    """How many lit stop lines a plan drives over."""
    driven = lanes_driven(plan)
    approaches = [a for a, b in pairwise(driven) if town.lanes.junction[b] >= 0]
    lines = town.lanes.stop_line[approaches]
    kinds = town.signals.kind[town.signals.stop_signal[lines[lines >= 0]]]
    return int((kinds == SignalKind.LIGHT).sum())


def junctions(town: Town, plan: RoutePlan) -> list[int]:
    crossed = town.lanes.junction[list(lanes_driven(plan))]
    return [int(junction) for junction in crossed if junction >= 0]


# -- the shipped suites ----------------------------------------------------------------------------


def test_four_suites_are_shipped() -> None:
    assert suite_names() == ("town05_long", "town05_short", "town05_tiny", "toy")
    for name in suite_names():
        suite = load_suite(name)
        assert suite.name == name
        assert suite.version >= 1
        assert suite.timeout_rule == "carla-1.0"
    assert load_suite("town05_long").traffic == TrafficLevel(vehicles=120, walkers=60)


def test_the_ten_long_routes_resemble_the_official_ones(plans: Plans, town05: Town) -> None:
    """Official: mean 1290 m, 11.5 junctions, 5.3 lane changes."""
    long = plans["town05_long"]
    assert len(long) == 10
    assert 1200 < np.mean([plan.length_m for plan in long]) < 1400
    assert 10 < np.mean([len(junctions(town05, plan)) for plan in long]) < 14
    assert 4 < np.mean([lane_changes(plan) for plan in long]) < 6.5
    assert min(plan.length_m for plan in long) > 500


def test_the_long_routes_reach_every_street_and_both_levels(plans: Plans, town05: Town) -> None:
    lanes = town05.lanes
    driven = {lane for plan in plans["town05_long"] for lane in lanes_driven(plan)}
    streets = set(lanes.road[(lanes.kind == 1) & (lanes.junction < 0)].tolist())
    assert {int(lanes.road[lane]) for lane in driven} >= streets
    tops = [plan.points[:, 2].max() for plan in plans["town05_long"]]
    assert sum(top > 9.0 for top in tops) >= 2
    # the three streets that pass under the ring cross x = -237 at y = -90, 0, 90
    below = np.concatenate([plan.points for plan in plans["town05_long"]])
    below = below[(np.abs(below[:, 0] + 237.0) < 2.0) & (below[:, 2] < 1.0)]
    assert set(np.rint(below[:, 1] / 90.0)) == {-1.0, 0.0, 1.0}


def test_the_short_routes_are_short_and_meet_one_light_at_most(plans: Plans, town05: Town) -> None:
    short = plans["town05_short"]
    assert len(short) == 32
    for plan in short:
        assert 70.0 <= plan.length_m <= 150.0, plan.route_id
        assert len(junctions(town05, plan)) <= 1, plan.route_id
        assert lights_met(town05, plan) <= 1, plan.route_id
    assert sum(lights_met(town05, plan) == 0 for plan in short) >= 16
    assert sum(len(junctions(town05, plan)) == 1 for plan in short) >= 24


def test_a_short_route_with_a_light_leaves_time_for_it(plans: Plans, town05: Town) -> None:
    """Waiting takes 50 s at most (60 s cycle, 10 s green); at 7 m/s the drive takes L / 7."""
    lit = [plan for plan in plans["town05_short"] if lights_met(town05, plan)]
    assert len(lit) >= 10
    for plan in lit:
        assert plan.timeout_s >= 50.0 + plan.length_m / 7.0, plan.route_id


def test_the_short_routes_hold_all_turns_and_lane_changes(plans: Plans, town05: Town) -> None:
    short = plans["town05_short"]
    made = [turn for plan in short for turn in turns(town05.lanes, plan)]
    assert all(made.count(turn) >= 4 for turn in (Turn.LEFT, Turn.RIGHT, Turn.STRAIGHT))
    assert sum(lane_changes(plan) >= 1 for plan in short) >= 10
    assert max(plan.points[:, 2].max() for plan in short) > 9.0


def test_the_tiny_routes_are_one_crossing_each_at_every_junction(
    plans: Plans, town05: Town
) -> None:
    tiny = plans["town05_tiny"]
    crossed = [junctions(town05, plan) for plan in tiny]
    assert all(len(each) == 1 for each in crossed)
    assert all(20.0 <= plan.length_m <= 60.0 for plan in tiny)
    counts = np.bincount([each[0] for each in crossed], minlength=len(town05.junction_names))
    assert len(counts) == 21
    assert counts.min() >= 4
    assert not any(lane_changes(plan) for plan in tiny)


@pytest.mark.parametrize("name", ["town05_long", "town05_short", "town05_tiny"])
def test_no_two_routes_of_a_suite_are_the_same(plans: Plans, name: str) -> None:
    ways = [(lanes_driven(plan), round(plan.lane_m[0])) for plan in plans[name]]
    assert len(set(ways)) == len(ways)


@pytest.mark.parametrize("name", ["town05_long", "town05_short", "town05_tiny"])
def test_shipped_routes_drive_forwards_from_point_to_point(plans: Plans, name: str) -> None:
    for plan in plans[name]:
        ahead = np.diff(plan.points[:, :2], axis=0)
        yaw = plan.points[:-1, 3]
        assert (ahead[:, 0] * np.cos(yaw) + ahead[:, 1] * np.sin(yaw)).min() > -0.5
        assert np.hypot(*ahead.T).max() < 8.0  # a lane change moves five points ahead


def test_the_route_files_are_what_the_script_writes(town05: Town) -> None:
    graph, toy = build_road_graph(town05), build_road_graph(load_town("toy"))
    lit = lit_junctions(town05.junction_names)
    built = {
        "town05_short": build_short(graph, "Town05", lit),
        "town05_tiny": build_tiny(graph, "Town05"),
        "toy": build_toy(toy, "toy"),
    }
    for name, routes in built.items():
        assert routes == read_routes(DATA / "routes" / f"{name}.xml"), name


def test_the_toy_suite_plans_in_the_toy_town() -> None:
    suite = load_suite("toy")
    toy = suite.plans(load_town("toy"))
    assert len(toy) == 7
    assert sum(lane_changes(plan) for plan in toy) == 1


# -- choosing --------------------------------------------------------------------------------------


def test_plans_can_be_asked_for_by_id_in_the_files_order() -> None:
    chosen = load_suite("toy").plans(load_town("toy"), route_ids=("3", "1"))
    assert [plan.route_id for plan in chosen] == ["1", "3"]


def test_unknown_names_are_refused_with_a_suggestion() -> None:
    with pytest.raises(ValueError, match=r"'town05_lnog'; did you mean 'town05_long'\?"):
        load_suite("town05_lnog")
    with pytest.raises(ValueError, match="Unknown route id in suite 'toy' '77'"):
        load_suite("toy").specs(route_ids=["77"])
    with pytest.raises(ValueError, match="'vehicles' must be a whole number >= 0, got -1"):
        TrafficLevel(vehicles=-1, walkers=0)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"wether": "ClearNoon"}, r"unknown field 'wether'; did you mean 'weather'\?"),
        ({"town": None}, "town: expected a text, got null"),
        ({"weather": "ClearNun"}, "did you mean 'ClearNoon'"),
        ({"traffic": {"vehicles": 3}}, r"traffic\.walkers: is missing"),
        ({"traffic": {"vehicles": 3, "walkers": True}}, r"traffic\.walkers: expected a whole numb"),
    ],
)
def test_a_wrong_suite_file_says_what_is_wrong(
    tmp_path: Path, change: dict[str, object], says: str
) -> None:
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(dataclasses.asdict(load_suite("toy")) | change))
    with pytest.raises(ValueError, match=rf"mine\.json: .*{says}"):
        read_suite(path)


def test_own_files_take_the_place_of_the_suites(shared: Path) -> None:
    town = shared / "data/xodr/Town05.xodr"
    routes = shared / "data/routes/routes_town05_long.xml"
    own = choose_suite(town=town, routes=routes, signals="town05")
    assert (own.name, own.version, own.signals) == ("routes_town05_long", 0, "town05")
    assert (own.town_path, own.routes_path) == (town, routes)
    assert own.max_snap_m == 60.0
    mixed = choose_suite("town05_short", town=town)
    assert mixed.routes_path == load_suite("town05_short").routes_path
    assert mixed.town_path == town
    assert choose_suite("town05_short") == load_suite("town05_short")


def test_neither_a_name_nor_both_files_is_refused(tmp_path: Path) -> None:
    for given in ({}, {"town": "town05"}, {"routes": "town05_long"}):
        with pytest.raises(ValueError, match=r"shipped suites: .*town05_long"):
            choose_suite(**given)
    with pytest.raises(ValueError, match=r"no file .*none\.xodr"):
        choose_suite("toy", town=tmp_path / "none.xodr")


def test_the_official_long_routes_can_be_driven_on_the_shipped_town(
    shared: Path, town05: Town
) -> None:
    own = choose_suite(town="town05", routes=shared / "data/routes/routes_town05_long.xml")
    assert len(own.plans(town05)) == 10


@pytest.mark.filterwarnings("ignore:several.xml. 1 of 2 routes are of toy:UserWarning")
def test_a_file_for_several_towns_gives_the_routes_of_the_one_asked_for(tmp_path: Path) -> None:
    points = '<waypoint x="-60" y="55.25" z="0"/><waypoint x="-50" y="55.25" z="0"/>'
    towns = ("Toy", "Town01")
    routes = "".join(f'<route id="{town}" town="{town}">{points}</route>' for town in towns)
    path = tmp_path / "several.xml"
    path.write_text(f"<routes>{routes}</routes>")
    own = choose_suite(town="toy", routes=path)
    assert [plan.route_id for plan in own.plans(load_town("toy"))] == ["Toy"]
    with pytest.raises(ValueError, match="no route is in town 'town05'; its towns: Toy, Town01"):
        own.specs("town05")


def test_a_shipped_route_off_its_lane_would_be_noticed(town05: Town) -> None:
    shifted = dataclasses.replace(load_suite("town05_short"), max_snap_m=0.0)
    with pytest.raises(RouteError, match="keypoint 0"):
        shifted.plans(town05)


def test_scenarios_are_the_suites_the_users_or_none(tmp_path: Path) -> None:
    shipped = choose_suite("town05_long").scenario_paths
    assert [path.name for path in shipped] == ["town05.json"]
    assert choose_suite("town05_long", scenarios="none").scenario_paths == ()
    assert choose_suite("town05_tiny").scenario_paths == ()
    assert choose_suite("toy", scenarios="toy").scenario_paths[0].name == "toy.json"
    assert choose_suite("town05_long", town="toy").scenario_paths == ()  # those of another town
    (tmp_path / "a.json").touch()
    both = f"{tmp_path / 'a.json'}, {tmp_path}"
    assert choose_suite("toy", scenarios=both).scenario_paths == (tmp_path / "a.json", tmp_path)
    with pytest.raises(ValueError, match=r"did you mean 'town05'\? known: town05, toy, none"):
        choose_suite("toy", scenarios="town5")
    with pytest.raises(ValueError, match=r"no trigger file or folder 'a/b\.json'"):
        choose_suite("toy", scenarios="a/b.json")


def test_plans_of_a_suite_hold_the_scenarios_of_their_town() -> None:
    suite = choose_suite("toy", scenarios="toy")
    town = load_town(suite.town_path)
    met = [trigger.type for plan in suite.plans(town) for trigger in plan.scenarios]
    assert sorted(met) == [1, 1, 3, 4, 4, 4, 4, 7, 7, 9, 10, 10, 10]
    with pytest.raises(ValueError, match="no scenario is placed in toy; its towns: Town05"):
        choose_suite("toy", scenarios="town05").plans(town)
