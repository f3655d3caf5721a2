"""Lanes read from small maps: frames, joined sections, links, neighbours, marks, speeds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from di_envs.town.lanes import LaneKind, Turn
from tests.di_envs.town.small_maps import (
    crossing,
    geometry,
    lane,
    load,
    one_street,
    opendrive,
    road,
    section,
)


def lane_index(town, lane_id, road_id="1"):
    """The driving lane of a road and id."""
    lanes = town.lanes
    road_index = town.road_names.index(road_id)
    (found,) = np.flatnonzero(
        (lanes.road == road_index) & (lanes.lane_id == lane_id) & (lanes.kind == LaneKind.DRIVING)
    )
    return int(found)


def points_of(town, index):
    first = town.lanes.first[index]
    return town.lanes.points[first : first + town.lanes.count[index]]


def successors_of(town, index):
    lanes = town.lanes
    return set(lanes.successor[lanes.successor_start[index] : lanes.successor_start[index + 1]])


def test_a_street_has_a_lane_each_way_on_the_right(tmp_path):
    town = load(one_street(), tmp_path)
    ahead, back = points_of(town, lane_index(town, -1)), points_of(town, lane_index(town, 1))
    # World y is south: the right lane of an eastbound driver lies at positive y.
    assert ahead[0] == pytest.approx((0.0, 1.75, 0.0, 0.0))
    assert ahead[-1] == pytest.approx((100.0, 1.75, 0.0, 0.0))
    assert back[0, :3] == pytest.approx((100.0, -1.75, 0.0))
    assert math.cos(back[0, 3]) == pytest.approx(-1.0)
    assert list(town.lanes.length_m) == pytest.approx([100.0, 100.0])
    assert list(town.lanes.count) == [201, 201]
    assert list(town.lanes.spacing_m) == pytest.approx([0.5, 0.5])


def test_under_left_hand_traffic_the_same_lanes_run_the_other_way(tmp_path):
    town = load(one_street(rule="LHT"), tmp_path)
    assert points_of(town, lane_index(town, -1))[0, 0] == 100.0
    assert points_of(town, lane_index(town, 1))[0, 0] == 0.0


@settings(
    max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None
)
@given(
    x=st.floats(-200.0, 200.0),
    y=st.floats(-200.0, 200.0),
    heading=st.floats(-3.1, 3.1),
    curvature=st.floats(-0.05, 0.05),
)
def test_the_frame_is_flipped_once(tmp_path, x, y, heading, curvature):
    shape = f'<arc curvature="{curvature!r}"/>'
    line = geometry(20.0, x=x, y=y, heading=heading, shape=shape)
    town = load(one_street(20.0, line=line), tmp_path)
    px, py, _, yaw = points_of(town, lane_index(town, -1))[0]
    # The reference line's start, mirrored, and half a lane to the right of its mirrored heading.
    assert math.cos(yaw + heading) == pytest.approx(1.0)
    assert px == pytest.approx(x - 1.75 * math.sin(-heading), abs=1e-6)
    assert py == pytest.approx(-y + 1.75 * math.cos(-heading), abs=1e-6)
    turned = points_of(town, lane_index(town, -1))[-1, 3] - yaw
    assert turned == pytest.approx(-20.0 * curvature, abs=1e-6)


def test_points_on_an_outer_lane_of_a_bend_are_evenly_spaced(tmp_path):
    quarter = 20.0 * math.pi / 2
    line = geometry(quarter, shape='<arc curvature="0.05"/>')
    town = load(one_street(quarter, line=line), tmp_path)
    index = lane_index(town, -1)  # 21.75 m from the centre of a bend to the left
    steps = np.hypot(*np.diff(points_of(town, index)[:, :2], axis=0).T)
    assert town.lanes.length_m[index] == pytest.approx(21.75 * math.pi / 2, abs=0.01)
    assert steps == pytest.approx(town.lanes.spacing_m[index], rel=1e-4)
    assert steps.max() <= 0.5


def test_the_longest_step_of_a_lane_is_over_the_jump_in_its_width(tmp_path):
    """From 3 to 9 m in one place: its middle leaps by half of that to the side."""
    wider = (
        '<width sOffset="0" a="3" b="0" c="0" d="0"/><width sOffset="20" a="9" b="0" c="0" d="0"/>'
    )
    town = load(opendrive(road("1", 40.0, section(0.0, lane(-1, width=wider)))), tmp_path)
    step = town.lanes.spacing_m[0]
    assert 3.0 < town.lanes.longest_step_m[0] <= math.hypot(3.0, step) + 1e-9


def test_yaw_does_not_jump_where_it_passes_a_half_turn(tmp_path):
    circle = 2.0 * math.pi * 30.0
    line = geometry(circle, heading=3.0, shape=f'<arc curvature="{1 / 30!r}"/>')
    town = load(one_street(circle, line=line), tmp_path)
    yaw = points_of(town, lane_index(town, -1))[:, 3]
    assert np.abs(np.diff(yaw)).max() < 0.05
    assert yaw[-1] - yaw[0] == pytest.approx(-2.0 * math.pi)
    assert -math.pi <= yaw[0] < math.pi


def test_lane_offset_and_elevation_move_the_lane(tmp_path):
    town = load(
        one_street(
            offset='<laneOffset s="0" a="1.5" b="0" c="0" d="0"/>',
            before='<elevationProfile><elevation s="0" a="2" b="0.1" c="0" d="0"/>'
            "</elevationProfile>",
        ),
        tmp_path,
    )
    points = points_of(town, lane_index(town, -1))
    assert points[0, :3] == pytest.approx((0.0, 0.25, 2.0))  # 1.5 m to the left of 1.75
    assert points[-1, 2] == pytest.approx(12.0)


def test_sections_that_go_on_one_to_one_are_one_lane(tmp_path):
    first = section(0.0, lane(-1, successor=-1))
    sliver = section(40.0, lane(-1, predecessor=-1, successor=-1))
    last = section(40.0004, lane(-1, predecessor=-1), lane(-2, kind="sidewalk"))
    town = load(opendrive(road("1", 100.0, first, sliver, last)), tmp_path)
    index = lane_index(town, -1)
    assert town.lanes.length_m[index] == pytest.approx(100.0)
    assert sorted(town.lanes.kind) == [LaneKind.DRIVING, LaneKind.SIDEWALK]
    (walk,) = np.flatnonzero(town.lanes.kind == LaneKind.SIDEWALK)
    assert town.lanes.length_m[walk] == pytest.approx(59.9996)
    assert town.lanes.section[walk] == 2


def test_a_lane_that_is_renumbered_goes_on(tmp_path):
    first = section(0.0, lane(-1, successor=-2))
    nothing = '<width sOffset="0" a="0" b="0" c="0" d="0"/>'
    second = section(50.0, lane(-1, kind="median", width=nothing), lane(-2, predecessor=-1))
    town = load(opendrive(road("1", 100.0, first, second)), tmp_path)
    assert town.lanes.length_m[lane_index(town, -1)] == pytest.approx(100.0)


def test_a_second_lane_that_begins_makes_new_lanes_with_links(tmp_path):
    first = section(0.0, lane(-1, successor=-1))
    growing = '<width sOffset="0" a="0" b="0.07" c="0" d="0"/>'
    second = section(50.0, lane(-1, predecessor=-1), lane(-2, width=growing))
    town = load(opendrive(road("1", 100.0, first, second)), tmp_path)
    lanes = town.lanes
    (before,) = np.flatnonzero(lanes.section == 0)
    after, new = np.flatnonzero(lanes.section == 1)[::-1]
    assert successors_of(town, before) == {after}
    assert lanes.right[after] == new
    assert lanes.left[new] == after
    assert lanes.left[after] == -1
    assert lanes.width_m[lanes.first[new]] == 0.0  # no width where it begins
    assert lanes.width_m[lanes.first[new] + lanes.count[new] - 1] == pytest.approx(3.5)


def test_a_section_without_length_keeps_its_links(tmp_path):
    first = section(0.0, lane(-1, successor=-1))
    none = section(50.0, lane(-1, predecessor=-1, successor=-1), lane(-2))
    last = section(50.0, lane(-1, predecessor=-1))
    town = load(opendrive(road("1", 100.0, first, none, last)), tmp_path)
    lanes = town.lanes
    assert np.isfinite(lanes.points).all()
    assert (lanes.spacing_m > 0.0).all()
    (start,) = np.flatnonzero((lanes.section == 0) & (lanes.lane_id == -1))
    (middle,) = successors_of(town, start)
    (end,) = successors_of(town, middle)
    assert lanes.section[end] == 2


def test_roads_are_linked_end_to_end_in_both_directions(tmp_path):
    text = opendrive(
        road(
            "1",
            50.0,
            section(0.0, lane(1, successor=1), lane(-1, successor=-1)),
            links='<successor elementType="road" elementId="2" contactPoint="start"/>',
        ),
        road("2", 50.0, section(0.0, lane(1), lane(-1)), x=50.0),
    )
    town = load(text, tmp_path)
    assert successors_of(town, lane_index(town, -1, "1")) == {lane_index(town, -1, "2")}
    assert successors_of(town, lane_index(town, 1, "2")) == {lane_index(town, 1, "1")}
    lanes, after = town.lanes, lane_index(town, -1, "2")
    before = lanes.predecessor[lanes.predecessor_start[after] : lanes.predecessor_start[after + 1]]
    assert list(before) == [lane_index(town, -1, "1")]


def test_roads_may_meet_head_to_head(tmp_path):
    text = opendrive(
        road(
            "1",
            50.0,
            section(0.0, lane(1, successor=-1), lane(-1, successor=1)),
            links='<successor elementType="road" elementId="2" contactPoint="end"/>',
        ),
        road("2", 50.0, section(0.0, lane(1), lane(-1)), x=100.0, heading=math.pi),
    )
    town = load(text, tmp_path)
    assert successors_of(town, lane_index(town, -1, "1")) == {lane_index(town, 1, "2")}
    assert successors_of(town, lane_index(town, -1, "2")) == {lane_index(town, 1, "1")}


def test_junction_lanes_lead_from_street_to_street(tmp_path):
    town = load(crossing(), tmp_path)
    (way,) = successors_of(town, lane_index(town, -1, "1"))
    assert town.lanes.junction[way] == 0
    assert town.lanes.turn[way] == Turn.STRAIGHT
    assert successors_of(town, way) == {lane_index(town, 1, "3")}


@pytest.mark.parametrize(
    ("curvature", "turn"),
    [(0.1, Turn.LEFT), (-0.1, Turn.RIGHT), (0.01, Turn.STRAIGHT)],
)
def test_a_turn_is_told_by_its_change_of_heading(tmp_path, curvature, turn):
    line = geometry(15.0, shape=f'<arc curvature="{curvature}"/>')
    text = opendrive(road("1", 15.0, section(0.0, lane(-1)), line=line, junction="5"))
    town = load(text, tmp_path)
    assert town.junction_names == ("5",)
    assert list(town.lanes.turn) == [turn]


def _mark(text):
    return f'<roadMark sOffset="0" {text}/>'


def changes(town, lane_id):
    index = lane_index(town, lane_id)
    first = town.lanes.first[index]
    return set(town.lanes.change[first : first + town.lanes.count[index]])


@pytest.mark.parametrize(
    ("mark", "inner", "outer"),
    [
        ('type="broken" laneChange="both"', 2, 1),
        ('type="broken"', 2, 1),  # by its type where it does not say
        ('type="solid"', 0, 0),
        ('type="broken" laneChange="none"', 0, 0),
        # Right of the centre ids fall outwards: increasing leads from the outer to the inner lane.
        ('type="broken" laneChange="increase"', 0, 1),
        ('type="broken" laneChange="decrease"', 2, 0),
    ],
)
def test_the_outer_mark_of_the_inner_lane_governs_changes(tmp_path, mark, inner, outer):
    lanes = section(0.0, lane(-1, mark=_mark(mark)), lane(-2), centre=_mark('type="broken"'))
    town = load(opendrive(road("1", 50.0, lanes)), tmp_path)
    assert changes(town, -1) == {inner}  # bit 1 left, bit 2 right; never over the centre line
    assert changes(town, -2) == {outer}


def test_a_mark_may_change_on_the_way(tmp_path):
    marks = '<roadMark sOffset="0" type="broken"/><roadMark sOffset="30" type="solid"/>'
    town = load(opendrive(road("1", 50.0, section(0.0, lane(-1, mark=marks), lane(-2)))), tmp_path)
    first = town.lanes.first[lane_index(town, -1)]
    change = town.lanes.change[first : first + 101]
    assert set(change[:60]) == {2}
    assert set(change[61:]) == {0}


def test_lanes_of_the_other_direction_are_no_neighbours(tmp_path):
    town = load(one_street(), tmp_path)
    assert set(town.lanes.left) == {-1}
    assert set(town.lanes.right) == {-1}


def test_left_of_a_left_lane_of_the_road_is_towards_its_centre(tmp_path):
    town = load(opendrive(road("1", 50.0, section(0.0, lane(2), lane(1)))), tmp_path)
    assert town.lanes.left[lane_index(town, 2)] == lane_index(town, 1)
    assert town.lanes.right[lane_index(town, 1)] == lane_index(town, 2)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('<speed max="30" unit="mph"/>', 13.4112),
        ('<speed max="36" unit="km/h"/>', 10.0),
        ('<speed max="12"/>', 12.0),
        ('<speed max="no limit"/>', 50.0 / 3.6),
    ],
)
def test_speed_limits_have_units(tmp_path, text, expected):
    town = load(one_street(before=f'<type s="0" type="town">{text}</type>'), tmp_path)
    assert town.lanes.speed_limit_mps == pytest.approx(expected)


def test_a_lanes_own_limit_goes_before_its_roads(tmp_path):
    own = lane(-1, speed='<speed sOffset="0" max="5" unit="m/s"/>')
    kind = '<type s="0" type="town"><speed max="20" unit="m/s"/></type>'
    town = load(opendrive(road("1", 50.0, section(0.0, own, lane(1)), before=kind)), tmp_path)
    assert town.lanes.speed_limit_mps[lane_index(town, -1)] == 5.0
    assert town.lanes.speed_limit_mps[lane_index(town, 1)] == 20.0


def test_a_junction_lane_takes_the_limit_of_the_lane_before_it(tmp_path):
    limit = '<type s="0" type="town"><speed max="8" unit="m/s"/></type>'
    text = crossing().replace("<planView>", f"{limit}<planView>", 1)  # street 1 only
    town = load(text, tmp_path)
    (way,) = successors_of(town, lane_index(town, -1, "1"))
    assert town.lanes.speed_limit_mps[way] == 8.0


def test_every_point_is_in_the_cell_that_it_lies_in(tmp_path):
    lanes = load(crossing(), tmp_path).lanes
    columns, rows = lanes.grid_size
    assert sorted(lanes.cell_point) == list(range(len(lanes.points)))
    for cell in range(columns * rows):
        low = lanes.grid_origin + lanes.cell_m * (cell % columns, cell // columns)
        for point in lanes.cell_point[lanes.cell_start[cell] : lanes.cell_start[cell + 1]]:
            offset = lanes.points[point, :2] - low
            assert (offset >= 0.0).all()
            assert (offset < lanes.cell_m).all()


def test_crossing_lanes_conflict_three_metres_to_either_side(tmp_path):
    town = load(crossing(), tmp_path)
    lanes = town.lanes
    east_west = lane_index(town, -1, "11")
    rows = slice(lanes.conflict_start[east_west], lanes.conflict_start[east_west + 1])
    others = lanes.conflict_lane[rows]
    # Those from the south and the north cross; the one that comes towards it passes 3.5 m aside.
    assert sorted(others) == sorted([lane_index(town, -1, "12"), lane_index(town, -1, "14")])
    # It runs west at y = -1.75 from x = 10. The lane from the south runs at x = 1.75: they meet
    # at 8.25 m, and the points within 3 m of it lie from 5.5 m to 11 m, a quarter around each.
    k = list(others).index(lane_index(town, -1, "12")) + rows.start
    assert lanes.conflict_begin_m[k] == pytest.approx(5.25)
    assert lanes.conflict_end_m[k] == pytest.approx(11.25)


def test_conflicts_are_told_from_both_sides(tmp_path):
    lanes = load(crossing(2), tmp_path).lanes
    rows = [
        (i, int(lanes.conflict_lane[k]))
        for i in range(len(lanes.kind))
        for k in range(lanes.conflict_start[i], lanes.conflict_start[i + 1])
    ]
    assert rows
    assert {(b, a) for a, b in rows} == set(rows)


def test_lanes_of_one_road_do_not_conflict_however_narrow(tmp_path):
    narrow = '<width sOffset="0" a="2.5" b="0" c="0" d="0"/>'
    lanes = section(0.0, lane(-1, width=narrow), lane(-2, width=narrow))
    town = load(opendrive(road("1", 20.0, lanes, junction="5")), tmp_path)
    assert len(town.lanes.conflict_lane) == 0


def test_a_bridge_over_a_junction_lane_is_no_conflict(tmp_path):
    bridge = '<elevationProfile><elevation s="0" a="6" b="0" c="0" d="0"/></elevationProfile>'
    text = opendrive(
        road("1", 20.0, section(0.0, lane(-1)), junction="5"),
        road(
            "2",
            20.0,
            section(0.0, lane(-1)),
            junction="5",
            before=bridge,
            x=10.0,
            y=-10.0,
            heading=math.pi / 2,
        ),
    )
    assert len(load(text, tmp_path).lanes.conflict_lane) == 0
    ground = text.replace('a="6"', 'a="0"')
    assert len(load(ground, tmp_path).lanes.conflict_lane) == 2


def test_the_geo_reference_is_read_and_has_carlas_default(tmp_path):
    assert load(one_street(), tmp_path).geo_origin == (42.0, 2.0)
    header = "<geoReference><![CDATA[+proj=tmerc +lat_0=4.9e+1 +lon_0=-8 +k=1]]></geoReference>"
    text = one_street().replace("<header>", f"<header>{header}")
    assert load(text, tmp_path).geo_origin == (49.0, -8.0)


def test_a_namespace_is_no_obstacle(tmp_path):
    text = one_street().replace("<OpenDRIVE>", '<OpenDRIVE xmlns="http://asam.net/opendrive">')
    assert len(load(text, tmp_path).lanes.kind) == 2
