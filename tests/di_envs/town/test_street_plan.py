"""Tables of streets: what they say, and how wrong ones are refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from di_envs.town.building.junction_arms import arms_of, corner_pairs, movements
from di_envs.town.building.street_plan import CrossSection, read_plan
from di_envs.town.building.toy import FACTS
from di_envs.town.lanes import Turn


def changed(tmp_path: Path, change) -> Path:
    table = json.loads(FACTS.read_text(encoding="utf-8"))
    change(table)
    path = tmp_path / "facts.json"
    path.write_text(json.dumps(table), encoding="utf-8")
    return path


def test_a_street_of_two_lanes_is_seven_metres_from_its_middle_to_the_shoulder():
    section = CrossSection(lanes=2, speed_kmh=50.0)
    assert section.paved_m == 7.0
    assert [strip.kind for strip in section.strips()] == [
        *["driving"] * 2,
        *["shoulder", "border", "sidewalk"],
    ]


def test_a_median_moves_the_first_driving_lane_out_and_takes_the_first_lane_id():
    section = CrossSection(lanes=3, speed_kmh=80.0, median_m=3.5)
    assert section.inner_edge_m(1) == 1.75
    assert section.first_lane == 2


def test_the_table_is_turned_from_south_to_north_once():
    plan = read_plan(FACTS)
    middle = next(street for street in plan.streets if street.id == 13)
    assert middle.points == ((0, 35, 0.0), (0, -35, 0.0))


def test_a_misspelt_key_is_refused_with_the_right_one(tmp_path):
    path = changed(tmp_path, lambda table: table["streets"][0].update(seciton="wide"))
    with pytest.raises(
        ValueError, match=r"streets\[0\]: unknown field 'seciton'; did you mean 'section'"
    ):
        read_plan(path)


def test_an_unknown_section_is_refused_with_the_known_ones(tmp_path):
    path = changed(tmp_path, lambda table: table["streets"][0].update(section="broad"))
    with pytest.raises(
        ValueError, match=r"street 11 has section 'broad'; known: \['narrow', 'wide"
    ):
        read_plan(path)


def test_a_street_to_nowhere_is_refused(tmp_path):
    path = changed(tmp_path, lambda table: table["streets"][2].update(end=9))
    with pytest.raises(ValueError, match=r"street 13 joins junction 9, .* listed: \[1, 2\]"):
        read_plan(path)


def test_two_streets_of_one_id_are_refused(tmp_path):
    path = changed(tmp_path, lambda table: table["streets"][2].update(id=11))
    with pytest.raises(ValueError, match="an id to two streets"):
        read_plan(path)


def test_the_ways_across_the_toys_northern_junction_are_those_one_draws_on_paper():
    plan = read_plan(FACTS)
    ways = movements(plan.junctions[0], arms_of(plan.junctions[0], plan))
    drawn = {
        (way.source.street.id, way.target.street.id): (
            way.turn,
            way.source_lane,
            way.target_lane,
            way.lanes,
        )
        for way in ways
    }
    assert drawn == {
        (11, 12): (Turn.STRAIGHT, 1, 1, 2),
        (12, 11): (Turn.STRAIGHT, 1, 1, 2),
        (11, 13): (Turn.RIGHT, 2, 1, 1),  # from the west, heading east, the south is on the right
        (12, 13): (Turn.LEFT, 1, 1, 1),
        (13, 11): (Turn.LEFT, 1, 1, 1),
        (13, 12): (Turn.RIGHT, 1, 2, 1),
    }


def test_corners_join_each_arm_with_its_right_hand_neighbour():
    plan = read_plan(FACTS)
    pairs = corner_pairs(arms_of(plan.junctions[0], plan))
    assert {(a.street.id, b.street.id) for a, b in pairs} == {(11, 13), (13, 12), (12, 11)}
