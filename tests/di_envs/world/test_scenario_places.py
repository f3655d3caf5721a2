"""Where scenarios put what: worked out on paper for a straight street."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from di_envs.town.plan import ScenarioTrigger
from di_envs.world.scenarios.places import crossing_length, find_kerb, next_junction, other_light
from di_envs.world.scenarios.tables import actors_needed, scenario_tables
from tests.di_envs.world.scenario_street import (
    EAST,
    FROM_EAST,
    FROM_NORTH,
    FROM_WEST,
    route,
    street,
)

TOWN = street()
NORTH = -0.5 * math.pi


def tables(*scenarios):
    return scenario_tables(TOWN, (route(*scenarios),), 100)


def test_the_kerb_is_found_behind_the_lanes_to_the_right_and_the_parking_lane():
    plain, parking = find_kerb(TOWN, EAST, 10.0), find_kerb(TOWN, EAST, 40.0)
    assert (plain.lanes, plain.parking, plain.edge_m, plain.width_m) == (1, False, 1.75, 3.5)
    assert (parking.lanes, parking.parking, parking.width_m) == (1, True, 2.0)
    assert parking.offset_m == pytest.approx(2.75)  # from y = 3.5 to 6.25


def test_debris_lies_14_48_and_74_metres_ahead_and_not_beyond_the_routes_end():
    table = tables((1, "", 10))
    assert table.pose[:, 0].tolist() == [24.0, 58.0, 84.0]
    assert table.end_m[0] == 120.0
    late = tables((1, "", 160))
    assert late.pose[:2, 0].tolist() == [174.0, 208.0]
    assert np.isnan(late.pose[2]).all()


def test_somebody_waits_12_metres_ahead_and_a_metre_and_a_half_more_for_each_lane():
    table = tables((3, "", 5))
    x, y, _, yaw = table.pose[0]
    assert x == 19.0  # 5 + 12 + 1.5, at the next route point; before the parking lane
    assert y == pytest.approx(7.0)  # a lane's width beyond the last lane's middle
    assert yaw == pytest.approx(NORTH)
    assert table.speed_mps[0] == pytest.approx(3.0 + 0.4 * 3)
    assert table.begin_m[0] == pytest.approx(19.0 - 12.0 - 3)
    # from y = 7 across to the far edge of the oncoming lane, y = -5.25, and a metre
    assert table.crossing_m[0] == pytest.approx(12.25 + 1.0, abs=0.5)


def test_the_vending_machine_stands_before_him_and_beside_the_lane():
    table = tables((3, "", 5))
    x, y, _, yaw = table.pose[1]
    assert (x, y) == (pytest.approx(19.0 - 1.4), pytest.approx(0.9 * 7.0))
    assert yaw == pytest.approx(-NORTH)
    assert y - 0.45 > 3.5 + 1.75 + 0.2


def test_he_stands_on_this_side_of_a_junction():
    table = tables((3, "", 95))
    assert table.pose[0, 0] == 99.0


def test_the_cyclist_waits_behind_the_junction():
    table = tables((4, "S4left", 80))
    x, y, _, yaw = table.pose[0]
    assert (x, y) == (129.0, pytest.approx(3.5))  # 120 + 8, and one for its one lane
    assert yaw == pytest.approx(NORTH)
    travel = 3.5 + 1.1 * 3.5
    assert table.begin_m[0] == pytest.approx(129.0 - 13.0 - travel)
    assert table.speed_mps[0] == 10.0
    assert table.crossing_m[0] == pytest.approx(travel)


def test_without_a_junction_ahead_there_is_no_cyclist():
    assert np.isnan(tables((4, "S4left", 150)).pose).all()


def test_who_crosses_goes_on_to_beyond_the_last_lane():
    # lanes end at y = -5.25; places are looked at each half metre with a body of half a metre
    assert crossing_length(TOWN, (10.0, 7.0, 0.0, NORTH)) == pytest.approx(13.25, abs=0.5)


def test_the_lights_are_those_of_the_next_junction_and_of_the_arm_that_the_subtype_names():
    table = tables((7, "S7left", 70), (7, "S7opposite", 71), (8, "S8left", 72), (10, "", 73))
    assert table.signal.tolist() == [FROM_WEST, FROM_WEST, FROM_WEST, -1]
    # no arm is to the right of the ego: for S7opposite the left one is next
    assert table.other_signal.tolist() == [FROM_NORTH, FROM_NORTH, FROM_EAST, -1]
    assert table.stop[0].tolist() == [100.0, 0.0, 0.0]
    assert table.end_m[0] == 120.0
    assert table.red_ticks[0] == round((1.5 + 0.04 * math.hypot(13.0, 15.0)) / 0.05)
    assert table.red_ticks[2] == round((1.5 + 0.04 * math.hypot(40.0, 3.5)) / 0.05)


def test_without_a_light_ahead_there_is_nothing_to_play_with():
    assert tables((7, "S7left", 150)).signal.tolist() == [-1]
    assert other_light(TOWN, FROM_NORTH, ("opposite",)) == -1


def test_junctions_ahead_are_found_from_before_and_from_inside():
    plan = route()
    assert next_junction(TOWN, plan, 0) == (100, 120)
    assert next_junction(TOWN, plan, 110) == (110, 120)
    assert next_junction(TOWN, plan, 130) == (221, 221)


def test_slots_follow_each_other_and_each_trigger_has_its_own():
    table = tables((1, "", 5), (3, "", 10), (7, "S7left", 20), (4, "S4left", 30))
    assert table.first_actor.tolist() == [100, 103, 105, 105, 106]
    assert table.start.tolist() == [0, 4]


def test_unknown_types_and_variants_are_refused_with_the_known_ones():
    plan = dataclasses.replace(route(), scenarios=(ScenarioTrigger(type=2, subtype="", point=3),))
    with pytest.raises(ValueError, match="trigger of scenario 2; there are 1, 3, 4, 7, 8, 9, 10"):
        actors_needed([plan])
    with pytest.raises(ValueError, match="did you mean 'S7left'"):
        tables((7, "S7lefft", 20))
