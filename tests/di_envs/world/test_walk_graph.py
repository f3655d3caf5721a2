"""Where walkers walk: sidewalks, crosswalks, what joins them, and the room beside them."""

import math

import pytest

from di_envs.town.lanes import LaneKind
from di_envs.world.walkers.walk_graph import build_walk_graph, walking_lines
from tests.di_envs.world.crossings import OPEN, WITH_LIGHT
from tests.di_envs.world.small_world import LaneSpec, make_lanes, make_town


def test_sidewalks_are_cut_where_a_crosswalk_leaves_them():
    walk = build_walk_graph(OPEN)
    assert sorted(walk.length_m.round(6)) == [20.0, 20.0, 20.0, 80.0, 80.0]
    assert list(walk.crosswalk == 0) == [False] * 4 + [True]
    for end in (8, 9):  # both ends of the crosswalk lead to two pieces of sidewalk
        assert walk.next_start[end + 1] - walk.next_start[end] == 2


def test_the_driving_part_of_a_crosswalk_is_where_lanes_lie_below_it():
    walk = build_walk_graph(OPEN)
    assert walk.length_m[4] == 20.0  # from y = 10 to y = -10
    assert walk.road_begin_m[4] == pytest.approx(4.75, abs=0.11)
    assert walk.road_end_m[4] == pytest.approx(15.25, abs=0.11)
    assert list(walk.strip[0]) == [80.0, 0.0, 0.0, -math.pi / 2, 5.5, 1.5]


def test_a_crosswalk_before_a_stop_line_heeds_its_light():
    assert list(build_walk_graph(WITH_LIGHT).light) == [0]
    assert list(build_walk_graph(OPEN).light) == []


def test_sidewalk_that_lies_on_driving_lanes_is_left_out():
    lanes = make_lanes(
        (
            LaneSpec(start=(0, 0), end=(100, 0), road=0, lane_id=-1),
            LaneSpec(start=(50, -50), end=(50, 50), road=1, lane_id=-1, kind=LaneKind.SIDEWALK),
        )
    )
    walk = build_walk_graph(make_town(lanes))
    lengths = sorted(walk.length_m)
    # 1.75 m of lane and 0.65 m for the walker to each side of y = 0, in steps of half a metre
    assert len(lengths) == 2
    assert lengths == pytest.approx([47.5, 47.5], abs=0.51)


def test_nobody_walks_where_the_whole_way_is_shorter_than_twenty_metres():
    """Two pieces that meet count as one; a few people on a short one would jam for ever."""
    walks = (((0, 9), (12, 9)), ((12, 9), (21, 9)), ((60, 9), (79, 9)))
    lanes = make_lanes(
        (
            LaneSpec(start=(0, 0), end=(100, 0), road=0, lane_id=-1),
            *(
                LaneSpec(start=start, end=end, road=1 + k, lane_id=-1, kind=LaneKind.SIDEWALK)
                for k, (start, end) in enumerate(walks)
            ),
        )
    )
    assert build_walk_graph(make_town(lanes)).length_m.tolist() == [12.0, 9.0]


def test_sidewalk_ends_that_nearly_meet_are_joined():
    sidewalk = {"road": 0, "kind": LaneKind.SIDEWALK}
    lanes = make_lanes(
        (
            LaneSpec(start=(0, 0), end=(40, 0), lane_id=-1, **sidewalk),
            LaneSpec(start=(42, 0), end=(80, 0), lane_id=-2, **sidewalk),
            LaneSpec(start=(84, 0), end=(109, 0), lane_id=-3, **sidewalk),
        )
    )
    walk = build_walk_graph(make_town(lanes))
    assert sorted(walk.length_m.round(6)) == [2.0, 25.0, 38.0, 40.0]


def test_a_sidewalk_beside_a_road_has_its_room_on_the_other_side():
    lanes = make_lanes(
        (
            LaneSpec(start=(0, 0), end=(100, 0), road=0, lane_id=-1),
            LaneSpec(start=(0, 2.75), end=(100, 2.75), road=0, lane_id=-2, kind=LaneKind.SIDEWALK),
        )
    )
    walk = build_walk_graph(make_town(lanes))  # the line is 1 m from the lane; heading east
    assert (walk.left_m[0], walk.right_m[0]) == (0.0, 1.25)
    assert (walk.forth_m[0], walk.back_m[0]) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("left", "right", "forth", "back"),
    [
        (1.25, 1.25, 0.5, -0.5),  # room on both sides: half a metre to each
        (1.25, 0.0, 0.0, -1.0),  # a road on the right: a metre between them all the same
        (0.25, 1.25, 0.75, -0.25),
        (0.25, 0.25, 0.25, -0.25),  # as far apart as there is room
        (0.0, 0.0, 0.0, 0.0),
    ],
)
def test_walkers_go_and_come_on_lines_a_metre_apart_where_there_is_room(left, right, forth, back):
    assert walking_lines(left, right) == (forth, back)
