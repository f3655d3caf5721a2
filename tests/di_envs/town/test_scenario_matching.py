"""Which scenarios a route meets: distance, direction, height, turns, and who wins at one place."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from di_envs.suites import choose_suite, load_suite, suite_names
from di_envs.town.building.scenarios import SCENARIOS, build_scenarios
from di_envs.town.loading import load_town
from di_envs.town.plan import RoadOption, RoutePlan, ScenarioTrigger
from di_envs.town.routing.scenarios import STAGED, SUBTYPES, match_scenarios
from di_envs.town.routing.trigger_files import PlacedScenario, read_triggers, write_triggers

EAST = np.column_stack([np.arange(100.0), np.zeros(100), np.zeros(100), np.zeros(100)])
FOLLOW = np.full(100, RoadOption.LANEFOLLOW, dtype=np.int8)


def turning(command: RoadOption) -> NDArray[np.int8]:
    """The options of a route that turns at 60 to 70 m, after a lane change."""
    option = FOLLOW.copy()
    option[40:45] = RoadOption.CHANGELANELEFT
    option[60:70] = command
    return option


def at(
    number: int, x: float, y: float = 0.0, z: float = 0.0, yaw_deg: float = 0.0
) -> PlacedScenario:
    """A trigger."""
    return PlacedScenario(number, x, y, z, math.radians(yaw_deg))


def met(*placed: PlacedScenario, option: NDArray[np.int8] = FOLLOW) -> list[tuple[int, str, int]]:
    """What begins along the route east: type, subtype, point."""
    found = match_scenarios(EAST, option, placed)
    return [(trigger.type, trigger.subtype, trigger.point) for trigger in found]


def test_a_trigger_is_met_at_the_nearest_point_if_that_is_within_a_metre_and_a_half() -> None:
    assert met(at(3, 20.3)) == [(3, "", 20)]
    assert met(at(3, 20.0, 1.4)) == [(3, "", 20)]


@pytest.mark.parametrize(
    "place",
    [
        at(3, 20.0, 2.1),
        at(3, 20.0, 1.6),  # within the 2 m of a match, never within the 1.5 m of a beginning
        at(3, 20.0, 0.0, 9.0),  # on the bridge above
        at(3, 20.0, yaw_deg=11.0),
        at(3, 20.0, yaw_deg=180.0),
        at(2, 20.0),  # not staged
    ],
)
def test_a_trigger_beside_above_or_across_the_route_is_not_met(place: PlacedScenario) -> None:
    assert met(place) == []


def test_yaw_is_compared_around_the_circle() -> None:
    assert met(at(3, 20.0, yaw_deg=355.0)) == [(3, "", 20)]


def test_of_several_at_one_place_the_highest_number_wins() -> None:
    assert met(at(3, 20.0), at(10, 20.6), at(1, 20.0)) == [(10, "", 21)]


def test_a_scenario_that_the_turn_does_not_fit_leaves_the_place_to_another() -> None:
    placed = (at(7, 20.0), at(8, 20.0), at(9, 20.0))
    assert met(*placed, option=turning(RoadOption.LEFT)) == [(8, "S8left", 20)]
    assert met(*placed, option=turning(RoadOption.RIGHT)) == [(9, "S9right", 20)]
    assert met(*placed, option=turning(RoadOption.STRAIGHT)) == [(7, "S7opposite", 20)]


@pytest.mark.parametrize(
    ("number", "command", "subtype"),
    [
        (number, command, name)
        for number, names in SUBTYPES.items()
        for command, name in names.items()
    ],
)
def test_the_next_turn_names_the_variant(number: int, command: RoadOption, subtype: str) -> None:
    assert met(at(number, 20.0), option=turning(command)) == [(number, subtype, 20)]


def test_a_route_that_turns_no_more_or_otherwise_has_none_that_need_a_turn() -> None:
    assert met(*(at(number, 20.0) for number in SUBTYPES)) == []
    assert met(at(4, 20.0), option=turning(RoadOption.STRAIGHT)) == []
    assert met(at(9, 20.0), option=turning(RoadOption.LEFT)) == []
    assert met(at(4, 80.0), option=turning(RoadOption.LEFT)) == []  # behind it


def test_two_that_would_begin_at_one_point_begin_one_after_the_other() -> None:
    # 2.2 m apart, so two places, both nearest to the point at 20 m
    assert met(at(3, 20.0, 1.1), at(4, 20.0, -1.1), option=turning(RoadOption.LEFT)) == [
        (3, "", 20),
        (4, "S4left", 21),
    ]


def test_a_route_that_passes_twice_begins_it_the_first_time() -> None:
    twice = np.concatenate([EAST, EAST])
    found = match_scenarios(twice, np.concatenate([FOLLOW, FOLLOW]), [at(3, 20.0)])
    assert found == (ScenarioTrigger(type=3, subtype="", point=20),)


def official(shared: Path, routes: str) -> tuple[RoutePlan, ...]:
    """The benchmark's own routes with TransFuser's trigger files."""
    data = shared / "data"
    suite = choose_suite(
        town=data / "xodr/Town05.xodr",
        routes=data / f"routes/routes_town05_{routes}.xml",
        signals="town05",
        scenarios=str(data / "scenarios"),
    )
    return suite.plans(load_town(suite.town_path, suite.signals))


@pytest.mark.filterwarnings("ignore:routes_town05_short.xml. 31 of 32 routes look odd")
def test_the_official_routes_have_as_many_places_as_counted_elsewhere(shared: Path) -> None:
    """Counts of distinct triggers from facts/route_facts.md, made by other code."""
    long = [19, 8, 21, 8, 20, 11, 14, 26, 40, 29]
    assert [len(plan.scenarios) for plan in official(shared, "long")] == long
    # of each of routes 5 and 31 one place fewer than counted: it is never within 1.5 m
    short = [2, 1, 7, 2, 0, 1, 5, 4, 5, 6, 6, 6, 6, 0, 6, 6, 4, 5, 5, 11, 2, 7, 8, 8, 0, 8]
    short += [10, 12, 3, 1, 9, 1]
    assert [len(plan.scenarios) for plan in official(shared, "short")] == short


def test_the_shipped_files_are_what_the_script_makes_of_the_shipped_towns(tmp_path: Path) -> None:
    for name, town in (("town05", "Town05"), ("toy", "toy")):
        write_triggers(tmp_path / "again.json", town, build_scenarios(load_town(name)))
        again = (tmp_path / "again.json").read_text(encoding="utf-8")
        assert (SCENARIOS / f"{name}.json").read_text(encoding="utf-8") == again


def test_shipped_triggers_lie_in_driving_lanes_before_junctions_and_on_streets() -> None:
    town = load_town("town05")
    lanes = town.lanes
    for place in read_triggers(SCENARIOS / "town05.json", ["Town05"]):
        away_m = np.linalg.norm(lanes.points[:, :3] - np.array(place[1:4]), axis=1)
        lane = int(lanes.point_lane[np.argmin(away_m)])
        assert away_m.min() < 0.3
        assert lanes.junction[lane] < 0
        following = lanes.successor[lanes.successor_start[lane]]
        lit = town.signals.groups[lanes.junction[following]] > 0
        assert place.number in (1, 3, 4) or lit == (place.number != 10)


@pytest.mark.parametrize("name", ["town05_long", "town05_short"])
def test_every_type_begins_somewhere_in_the_suites_with_scenarios(name: str) -> None:
    suite = load_suite(name)
    plans = suite.plans(load_town(suite.town_path, suite.signals))
    counts = Counter(trigger.type for plan in plans for trigger in plan.scenarios)
    assert set(counts) == set(STAGED)


def test_shipped_long_routes_meet_about_as_many_as_the_official_ones(shared: Path) -> None:
    """Per kilometre, within a third; S1 apart: the official ones always lie below an S3."""

    def per_km(plans: tuple[RoutePlan, ...]) -> dict[int, float]:
        km = sum(plan.length_m for plan in plans) / 1000.0
        counts = Counter(trigger.type for plan in plans for trigger in plan.scenarios)
        return {kind: counts[kind] / km for kind in STAGED}

    suite = load_suite("town05_long")
    ours = per_km(suite.plans(load_town(suite.town_path, suite.signals)))
    theirs = per_km(official(shared, "long"))
    assert sum(ours.values()) == pytest.approx(sum(theirs.values()), rel=0.2)
    for kind in (3, 4, 7, 8, 9, 10):
        assert ours[kind] == pytest.approx(theirs[kind], rel=0.5)


def test_only_long_and_short_have_scenarios_by_default() -> None:
    have = {name for name in suite_names() if load_suite(name).scenarios is not None}
    assert have == {"town05_long", "town05_short"}
