"""The toy town: figures that one can follow on paper."""

from __future__ import annotations

import math

import numpy as np
import pytest

from di_envs.town.building.toy import TOY, build_toy
from di_envs.town.lanes import LaneKind
from di_envs.town.loading import load_town
from tests.carla_wheel import carla_wheel


@pytest.fixture(scope="module")
def lanes():
    return load_town("toy").lanes


def lane_of(lanes, road: str, lane_id: int) -> int:
    names = load_town("toy").road_names
    (index,) = np.flatnonzero((lanes.road == names.index(road)) & (lanes.lane_id == lane_id))
    return int(index)


def test_the_script_gives_the_shipped_file_byte_for_byte():
    assert build_toy().encode() == TOY.read_bytes()


def test_carla_loads_it_and_every_lane_leads_on():
    carla = carla_wheel()
    town = carla.Map("toy", TOY.read_text(encoding="utf-8"))
    waypoints = town.generate_waypoints(1.0)
    assert all(waypoint.next(0.5) and waypoint.previous(0.5) for waypoint in waypoints)
    assert len(town.get_crosswalks()) == 4 * 5


def test_ten_lanes_of_streets_and_eight_ways_at_each_junction(lanes):
    driving = lanes.kind == LaneKind.DRIVING
    assert (driving & (lanes.junction < 0)).sum() == 4 + 4 + 2
    # straight on over two lanes, both ways, and four single turns
    assert (driving & (lanes.junction == 0)).sum() == 2 * 2 + 4
    assert (driving & (lanes.junction == 1)).sum() == 2 * 2 + 4


def test_the_middle_street_is_seventy_metres_long_and_its_lanes_keep_to_the_right(lanes):
    south = lane_of(lanes, "13", -1)
    assert lanes.length_m[south] == pytest.approx(70.0)
    first = lanes.first[south]
    assert lanes.points[first] == pytest.approx((-1.75, -35.0, 0.0, math.pi / 2), abs=1e-5)
    assert lanes.speed_limit_mps[south] == pytest.approx(30.0 / 3.6)


def test_the_outer_lane_of_the_western_street_is_as_long_as_on_paper(lanes):
    """From (-15, -50) west, south and east again, driven westwards first: the lane 5.25 m to the
    right of the middle lies outside, so its corners have radii of 25.25 m."""
    outer = lane_of(lanes, "11", -2)
    straights = (100 - 15 - 20) + (100 - 2 * 20) + (100 - 15 - 20)
    assert lanes.length_m[outer] == pytest.approx(straights + math.pi * 25.25, abs=0.01)


def test_from_any_lane_every_lane_can_be_reached(lanes):
    driving = np.flatnonzero(lanes.kind == LaneKind.DRIVING).tolist()
    beside = {
        i: [int(j) for j in (lanes.left[i], lanes.right[i]) if j >= 0 and lanes.junction[i] < 0]
        for i in driving
    }
    for start in driving:
        seen, front = {start}, [start]
        while front:
            lane = front.pop()
            onward = lanes.successor[lanes.successor_start[lane] : lanes.successor_start[lane + 1]]
            for other in [*onward.tolist(), *beside[lane]]:
                if other not in seen:
                    seen.add(other)
                    front.append(other)
        assert len(seen) == len(driving)
