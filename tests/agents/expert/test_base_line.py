"""The base line: legs laid one behind the other, by arithmetic that a person can redo."""

from __future__ import annotations

import numpy as np
import pytest

from agents.expert.base_line import STEP_M, Points, curvature_of, extend, lay_out, resample
from agents.expert.legs import Leg, linked_runs
from tests.di_envs.world.small_world import EAST, EAST_RIGHT, make_lanes

LANES = make_lanes()  # EAST and, 3.5 m to its right, EAST_RIGHT: 100 m each


def test_the_line_jumps_to_the_new_lane_beside_where_it_left_the_old_one():
    runs = linked_runs([Leg(EAST, 0.0, 40.0), Leg(EAST_RIGHT, 55.0, 90.0)], LANES)
    line = lay_out(runs, LANES)
    assert [(jump.station_m, jump.leg) for jump in line.jumps] == [(40.0, 1)]
    assert line.jumps[0].shift_m == pytest.approx(-3.5)  # the old lane is to the left
    assert [leg.lane for leg in line.legs] == [EAST, EAST_RIGHT]
    assert line.legs[1].begin_m == 40.0
    assert line.legs[1].offset_m == pytest.approx(0.0)  # begun at 40 m of its lane, not at 55 m
    assert line.length_m == pytest.approx(90.0)


def test_an_extension_goes_on_with_the_last_leg():
    line = lay_out([[Leg(EAST, 0.0, 40.0)]], LANES)
    extend(line, [Leg(EAST, 40.0, 100.0)], LANES)
    assert len(line.legs) == 1
    assert line.legs[0].end_m == line.length_m == pytest.approx(100.0)


def test_of_two_points_at_a_jump_the_later_one_counts():
    station = np.array([0.0, 1.0, 1.0, 2.0, 3.0])
    side = np.array([0.0, 0.0, 3.5, 3.5, 3.5])
    flat = np.zeros(5)
    even = resample(Points(station, station, side, flat, flat))
    assert even.station_m.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]
    assert even.y.tolist() == [0.0, 0.0, 3.5, 3.5, 3.5, 3.5]


def test_a_circle_of_twenty_metres_has_the_curvature_of_one_twentieth():
    yaw = np.arange(40) * STEP_M / 20.0
    assert curvature_of(yaw)[2:-2] == pytest.approx(0.05)
