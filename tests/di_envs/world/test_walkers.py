"""Walkers: where they walk, when they cross, whom they wait for."""

import math
from dataclasses import replace

import numpy as np
import pytest

from di_envs.numerics.geometry import boxes_overlap
from di_envs.town.lanes import Crosswalks, LaneKind, LightState, SignalKind
from di_envs.town.loading import load_town
from di_envs.world.state import TICK_S, ActorKind
from di_envs.world.struck import strike
from di_envs.world.walkers.crossing import could_stop, ticks_to_green
from di_envs.world.walkers.lane_clearance import clearances
from di_envs.world.walkers.neighbours import make_neighbours
from di_envs.world.walkers.on_edges import mark_busy_crosswalks, place_on_edge
from di_envs.world.walkers.personal_space import CLEAR_M
from di_envs.world.walkers.spawn import spawn_walkers
from di_envs.world.walkers.strolling import move_walkers
from di_envs.world.walkers.walk_graph import build_walk_graph, walking_lines
from di_envs.world.world import World, WorldConfig
from tests.di_envs.world.small_world import (
    EAST,
    EAST_RIGHT,
    LANES,
    ONCOMING,
    LaneSpec,
    make_lanes,
    make_signals,
    make_state,
    make_town,
    put,
)

# the street of small_world with a sidewalk on its other side too, and a crosswalk at x = 80 that
# lies on the three driving lanes (y from -5.25 to 5.25)
STREET = make_lanes(
    (
        *LANES,
        LaneSpec(
            start=(0, -10), end=(100, -10), road=0, lane_id=2, kind=LaneKind.SIDEWALK, width=2.0
        ),
    )
)
CROSSWALK = Crosswalks(
    start=np.array([[80.0, 5.5, 0.0]]),
    end=np.array([[80.0, -5.5, 0.0]]),
    width_m=np.array([3.0]),
    crossed_start=np.array([0, 3], np.int32),
    crossed_lane=np.array([EAST, EAST_RIGHT, ONCOMING], np.int32),
    crossed_begin_m=np.array([78.5, 78.5, 18.5]),
    crossed_end_m=np.array([81.5, 81.5, 21.5]),
)
NO_SIGNALS = make_signals(SignalKind.YIELD)
OPEN = make_town(STREET, NO_SIGNALS, CROSSWALK)
WITH_LIGHT = replace(OPEN, signals=make_signals())
KERB = 10.0 - 5.25 - 1.25  # station at which walkers from the south wait


def walk_on(state, walk, first, end, signals=NO_SIGNALS):
    """One tick of the walkers [first, end)."""
    move_walkers(
        state,
        walk,
        signals,
        make_neighbours(state.kind.size, walk.approach_start.size - 1),
        first,
        end,
    )


class Crossing:
    """One walker (actor 2) at the southern kerb, an ego (0, absent) and a vehicle (1, absent)."""

    def __init__(self, town=OPEN):
        self.town, self.walk = town, build_walk_graph(town)
        self.state = make_state(vehicles=1, walkers=1)
        self.state.kind[:] = ActorKind.ABSENT
        self.edge = int(np.flatnonzero(self.walk.crosswalk == 0)[0])
        spawn_walkers(self.state, self.walk, 2, 1)
        self.go(self.edge, KERB - 0.15)
        self.state.desired_factor[2] = 1.5
        self.busy = np.zeros(1, np.int8)

    def tick(self, ticks=1):
        for _ in range(ticks):
            self.state.tick[()] += 1
            walk_on(self.state, self.walk, 2, 3, self.town.signals)
            mark_busy_crosswalks(self.state, self.walk, self.busy)

    def go(self, edge, station, direction=1, walker=2):
        """Puts a walker on an edge."""
        state = self.state
        state.walk_edge[walker], state.walk_m[walker] = edge, station
        state.walk_direction[walker] = direction
        place = place_on_edge(self.walk, edge, station, direction)
        state.x[walker], state.y[walker], state.z[walker], state.yaw[walker] = place

    @property
    def sidewalk(self):
        """The southern sidewalk west of the crosswalk, 80 m long."""
        return next(e for e in range(4) if self.walk.points[self.walk.first[e], 1] == 10.0)

    def car(self, front, lane=EAST, speed=10.0, actor=1):
        """A car whose front is at a station of a lane, on its way along it."""
        spec = LANES[lane]
        heading = math.atan2(spec.end[1] - spec.start[1], spec.end[0] - spec.start[0])
        middle = front - 2.4
        x = spec.start[0] + middle * math.cos(heading)
        put(self.state, actor, ActorKind.CAR, x, spec.start[1], yaw=heading, speed=speed)
        self.state.lane[actor], self.state.lane_m[actor] = lane, middle
        self.state.path[actor, 0] = lane

    @property
    def waits(self):
        return bool(self.state.walk_waiting[2] == 1)


# the graph


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


def test_a_town_without_sidewalks_has_no_walkers():
    walk = build_walk_graph(make_town(make_lanes(LANES[:2])))
    state = make_state(walkers=3)
    spawn_walkers(state, walk, 1, 3)
    assert list(state.kind[1:]) == [ActorKind.ABSENT] * 3
    walk_on(state, walk, 1, state.kind.size)


# strolling


def test_a_walker_s_start_depends_on_nobody_else():
    walk = build_walk_graph(OPEN)
    few, many = make_state(walkers=5), make_state(walkers=40)
    for state, count in ((few, 5), (many, 40)):
        state.seed[...] = 7
        spawn_walkers(state, walk, 1, count)
    assert np.array_equal(few.x[1:6], many.x[1:6])
    assert np.array_equal(few.desired_factor[1:6], many.desired_factor[1:6])
    many.seed[...] = 8
    spawn_walkers(many, walk, 1, 40)
    assert not np.array_equal(few.x[1:6], many.x[1:6])


def test_nobody_starts_on_somebody_else_and_paces_differ():
    walk = build_walk_graph(OPEN)
    state = make_state(walkers=30)
    spawn_walkers(state, walk, 1, 30)
    present = np.flatnonzero(state.kind == ActorKind.WALKER)
    assert len(present) >= 25  # on 200 m of sidewalk some find no place
    for edge in np.unique(state.walk_edge[present]):
        stations = np.sort(state.walk_m[present][state.walk_edge[present] == edge])
        assert (np.diff(stations) >= 1.5).all()
    pace = state.desired_factor[present]
    assert 0.8 <= pace.min() < 1.0
    assert 1.6 < pace.max() <= 1.8


def test_ten_seconds_at_a_metre_and_a_half_a_second_cover_fifteen_metres():
    crossing = Crossing()
    state = crossing.state
    crossing.go(crossing.sidewalk, 10.0)
    crossing.tick(200)
    assert state.walk_m[2] == pytest.approx(25.0)
    assert (state.x[2], state.speed[2]) == (pytest.approx(25.0), pytest.approx(1.5))


def test_walkers_keep_to_the_right_so_that_they_can_pass_each_other():
    crossing = Crossing()
    state = crossing.state
    for direction, side in ((1, 0.5), (-1, -0.5)):  # heading east, the right is south
        crossing.go(crossing.sidewalk, 40.0, direction)
        crossing.tick(40)
        assert state.y[2] - 10.0 == pytest.approx(side)


def test_a_fast_walker_does_not_walk_into_a_slow_one():
    walk = build_walk_graph(OPEN)
    state = make_state(walkers=2)
    spawn_walkers(state, walk, 1, 2)
    edge = int(np.flatnonzero(walk.length_m == 80.0)[0])
    state.desired_factor[1:] = 0.8, 1.8
    for walker, station in ((1, 10.0), (2, 5.0)):
        state.walk_edge[walker], state.walk_m[walker] = edge, station
        state.walk_direction[walker] = 1
        place = place_on_edge(walk, edge, station, 1)
        state.x[walker], state.y[walker], state.z[walker], state.yaw[walker] = place
    for _ in range(1000):
        state.tick[()] += 1
        walk_on(state, walk, 1, state.kind.size)
        assert state.walk_m[1] - state.walk_m[2] > CLEAR_M
    assert state.walk_m[1] == pytest.approx(50.0)
    assert state.walk_m[2] > 47.0


def test_two_who_meet_where_there_is_no_room_to_pass_stop_and_turn_back():
    walk = build_walk_graph(OPEN)
    no_room = dict.fromkeys(("forth_m", "back_m", "left_m", "right_m"), np.zeros(walk.size.size))
    walk = walk._replace(**no_room)
    state = make_state(walkers=2)
    spawn_walkers(state, walk, 1, 2)
    edge = int(np.flatnonzero(walk.length_m == 80.0)[0])
    state.desired_factor[1:] = 1.0
    for walker, station, direction in ((1, 10.0, 1), (2, 20.0, -1)):
        state.walk_edge[walker], state.walk_m[walker] = edge, station
        state.walk_direction[walker] = direction
        place = place_on_edge(walk, edge, station, direction)
        state.x[walker], state.y[walker], state.z[walker], state.yaw[walker] = place
    gaps = []
    for _ in range(300):
        state.tick[()] += 1
        walk_on(state, walk, 1, state.kind.size)
        gaps.append(abs(state.x[1] - state.x[2]))
    assert CLEAR_M <= min(gaps) < CLEAR_M + 0.1
    assert list(state.walk_direction[1:]) != [1, -1]
    assert state.speed[1:].min() > 0.9


def two_who_meet(walk, stations=(10.0, 20.0), directions=(1, -1), lateral=0.0):
    """Two walkers (actors 1 and 2) on the line of one sidewalk, `lateral` metres to its right."""
    walk = walk._replace(
        forth_m=np.full(walk.size.size, lateral), back_m=np.full(walk.size.size, lateral)
    )
    state = make_state(walkers=2)
    spawn_walkers(state, walk, 1, 2)
    edge = int(np.flatnonzero(walk.length_m == 80.0)[0])
    state.desired_factor[1:] = 1.0
    for walker, station, direction in zip((1, 2), stations, directions, strict=True):
        state.walk_edge[walker], state.walk_m[walker] = edge, station
        state.walk_direction[walker] = direction
        place = place_on_edge(walk, edge, station, direction)
        state.x[walker], state.y[walker], state.z[walker], state.yaw[walker] = place
    return state, walk


def test_two_who_meet_on_one_line_step_to_their_right_and_pass():
    state, walk = two_who_meet(build_walk_graph(OPEN))
    aside = np.zeros(2)
    for _ in range(300):
        state.tick[()] += 1
        walk_on(state, walk, 1, 3)
        assert math.hypot(state.x[1] - state.x[2], state.y[1] - state.y[2]) >= CLEAR_M - 1e-9
        right = (state.y[1:] - 10.0) * state.walk_direction[1:]  # heading east it is south
        aside = np.maximum(aside, right)
        assert right.min() > -0.2
    assert list(state.walk_direction[1:]) == [1, -1]
    assert state.walk_m[1] > 23.0
    assert state.walk_m[2] < 7.0
    assert aside.max() < 0.8


def test_where_the_right_is_the_road_one_steps_to_the_left():
    walk = build_walk_graph(OPEN)
    walk = walk._replace(right_m=np.zeros(walk.size.size))  # south of the line is no room
    state, walk = two_who_meet(walk)
    for _ in range(300):
        state.tick[()] += 1
        walk_on(state, walk, 1, 3)
        assert (state.y[1:] - 10.0).max() < 0.05
    assert state.walk_m[1] > 22.0
    assert state.walk_m[2] < 8.0


def test_one_who_stands_in_the_way_is_gone_round():
    state, walk = two_who_meet(build_walk_graph(OPEN))
    strike(state, 2)
    for _ in range(180):
        state.tick[()] += 1
        walk_on(state, walk, 1, 3)
    assert state.x[1] > 18.0
    assert list(state.walk_direction[1:]) == [1, -1]


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


def test_walkers_turn_round_where_a_sidewalk_ends():
    crossing = Crossing()
    state = crossing.state
    crossing.go(crossing.sidewalk, 0.05, -1)
    crossing.tick(1)
    assert (state.walk_edge[2], state.walk_direction[2]) == (crossing.sidewalk, 1)
    assert state.walk_m[2] == 0.0


def test_a_walker_stops_before_an_ego_that_stands_on_the_sidewalk():
    crossing = Crossing()
    state = crossing.state
    crossing.go(crossing.sidewalk, 10.0)
    crossing.tick(20)
    put(state, 0, ActorKind.CAR, 20.0, state.y[2])
    crossing.tick(150)
    assert state.speed[2] == 0.0
    assert 20.0 - 2.4 - 0.25 - 0.6 < state.x[2] < 20.0 - 2.4 - 0.25


# crossing


def test_a_free_crosswalk_is_crossed_at_once_and_is_busy_meanwhile():
    crossing = Crossing()
    crossing.tick(8)
    assert not crossing.waits
    busy = 0
    for _ in range(300):
        crossing.tick()
        busy += int(crossing.busy[0])
    assert crossing.walk.crosswalk[crossing.state.walk_edge[2]] == -1
    # 10.5 m of road, 1.25 m before and 0.25 m behind it, at 1.5 m/s
    assert busy * TICK_S == pytest.approx(12.0 / 1.5, abs=0.5)


@pytest.mark.parametrize(("lane", "begin"), [(EAST, 78.5), (EAST_RIGHT, 78.5), (ONCOMING, 18.5)])
def test_walkers_wait_for_a_car_that_could_not_stop_comfortably(lane, begin):
    # at 6 m/s: 36 / 5 + 0.7 * 6 + 3 = 14.4 m
    for gap, waits in ((14.3, True), (14.5, False)):
        crossing = Crossing()
        crossing.car(begin - gap, lane, speed=6.0)
        crossing.tick(8)
        assert crossing.waits == waits


def test_comfortable_stopping_distance_is_that_of_the_formula():
    assert could_stop(10.0, 30.0)  # 100 / 5 + 7 + 3
    assert not could_stop(10.0, 29.9)
    assert could_stop(0.0, 0.0)  # who stands, stands


def test_a_car_that_goes_elsewhere_or_has_passed_is_no_reason_to_wait():
    crossing = Crossing()
    crossing.car(70.0)
    crossing.state.path[1, 0] = ONCOMING
    crossing.tick(8)
    assert not crossing.waits
    crossing = Crossing()
    crossing.car(81.5 + 4.8 + 0.1)
    crossing.tick(8)
    assert not crossing.waits


def test_an_ego_s_way_is_unknown_so_walkers_wait_for_it():
    crossing = Crossing()
    crossing.car(70.0, actor=0)
    crossing.state.path[0, 0] = -1
    crossing.tick(8)
    assert crossing.waits


def test_nobody_steps_onto_a_strip_that_a_car_stands_on():
    crossing = Crossing()
    crossing.car(79.0, speed=0.0)
    crossing.tick(200)
    assert crossing.waits
    assert not crossing.busy[0]
    crossing.car(78.4, speed=0.0)  # it stands before the strip
    crossing.tick(8)
    assert not crossing.waits


def test_a_car_on_the_bridge_above_is_no_reason_to_wait():
    crossing = Crossing()
    crossing.car(80.0, speed=0.0)
    crossing.state.z[1], crossing.state.lane[1] = 10.0, -1
    crossing.tick(8)
    assert not crossing.waits


@pytest.mark.parametrize(
    ("light", "phase_ticks", "waits"),
    [
        (LightState.GREEN, 0, True),
        (LightState.YELLOW, 0, True),
        (LightState.RED, 0, False),  # 300 ticks until the other group's turn is over
        (LightState.RED, 150, True),  # 7.5 s left: 11.75 m at 1.5 m/s take 7.8 s, and one is spare
    ],
)
def test_walkers_cross_only_while_the_light_stays_red_long_enough(light, phase_ticks, waits):
    crossing = Crossing(WITH_LIGHT)
    crossing.state.light[0] = light
    crossing.state.phase_group[0], crossing.state.phase_ticks[0] = 1, phase_ticks
    crossing.tick(8)
    assert crossing.waits == waits


def test_the_time_to_green_counts_the_turns_of_the_others():
    signals = make_signals()  # group 0 of two, turns of 15 s
    assert ticks_to_green(signals, 0, 1, 100) == 200
    assert ticks_to_green(signals, 0, 0, 270) == 330  # its own turn ends first


def test_a_car_that_drives_on_regardless_makes_a_walker_pause():
    crossing = Crossing()
    crossing.tick(40)
    assert crossing.state.walk_m[2] > KERB
    crossing.car(80.0, EAST, speed=0.0)
    crossing.tick(60)
    state = crossing.state
    assert state.speed[2] == 0.0
    assert state.y[2] - 0.25 > 1.0  # the car's side
    assert crossing.busy[0]
    state.kind[1] = ActorKind.ABSENT
    crossing.tick(10)
    assert state.speed[2] > 0.0


def test_who_waits_for_forty_seconds_turns_back():
    crossing = Crossing()
    crossing.car(79.0, speed=0.0)
    crossing.tick(800)
    assert crossing.waits
    crossing.tick(5)
    assert crossing.state.walk_direction[2] == -1
    assert not crossing.busy[0]
    crossing.tick(100)
    assert crossing.walk.crosswalk[crossing.state.walk_edge[2]] == -1


def test_who_was_knocked_down_lies_for_ten_seconds():
    crossing = Crossing()
    crossing.tick(40)
    strike(crossing.state, 2)
    crossing.tick(200)
    assert crossing.state.kind[2] == ActorKind.WALKER
    assert crossing.busy[0]
    crossing.tick()
    assert crossing.state.kind[2] == ActorKind.ABSENT
    assert not crossing.busy[0]


# towns


def hits(state, vehicles, walkers):
    """Pairs of a vehicle and a walker whose boxes overlap."""
    near = np.abs(state.x[vehicles, None] - state.x[None, walkers]) < 8.0
    near &= np.abs(state.y[vehicles, None] - state.y[None, walkers]) < 8.0
    near &= np.abs(state.z[vehicles, None] - state.z[None, walkers]) < 3.0
    near &= state.kind[None, walkers] == ActorKind.WALKER
    found = []
    for v, w in np.argwhere(near):
        boxes = [
            (state.x[a], state.y[a], state.yaw[a], state.half_length[a], state.half_width[a])
            for a in (vehicles.start + v, walkers.start + w)
        ]
        if boxes_overlap(*boxes[0], *boxes[1]):
            found.append((int(v), int(w)))
    return found


@pytest.mark.parametrize(("name", "vehicles"), [("toy", 20), ("town05", 120)])
def test_traffic_never_touches_a_walker_and_walkers_do_cross(name, vehicles):
    town = load_town(name)
    world = World(town, WorldConfig(vehicles=vehicles, walkers=60))
    world.reset(3, [])
    state, walk = world.view.state, build_walk_graph(town)
    walkers = slice(vehicles, vehicles + 60)
    crossed = 0
    for _ in range(480):
        before = walk.crosswalk[state.walk_edge[walkers]] >= 0
        world.advance(np.zeros((0, 3)), 5)
        assert hits(state, slice(0, vehicles), walkers) == []
        after = walk.crosswalk[state.walk_edge[walkers]] >= 0
        crossed += np.count_nonzero(before & ~after)
        strolling = np.column_stack((state.x, state.y, state.z))[walkers][~after]
        assert clearances(town.lanes, strolling).min() >= 0.25 + 0.4 - 1e-6
    assert crossed >= 10


@pytest.mark.parametrize(("walkers", "seed"), [(60, 0), (120, 1)])
def test_nobody_is_stuck_for_two_minutes(walkers, seed):
    """Ten minutes of the shipped town; who stays within three metres gets nowhere."""
    world = World(load_town("town05"), WorldConfig(vehicles=120, walkers=walkers))
    world.reset(seed, [])
    state, slots = world.view.state, slice(120, 120 + walkers)
    anchor, since = np.column_stack((state.x, state.y))[slots], np.zeros(walkers)
    for second in range(600):
        world.advance(np.zeros((0, 3)), 20)
        here = np.column_stack((state.x, state.y))[slots]
        gone = np.hypot(*(here - anchor).T) > 3.0
        anchor[gone], since[gone] = here[gone], second
        assert second - since.min() <= 120.0
        apart = np.hypot(*(here[:, None] - here[None]).T) + 9.0 * np.eye(walkers)
        level = np.abs(state.z[slots, None] - state.z[None, slots]) < 3.0
        assert apart[level].min() >= CLEAR_M - 1e-9
    assert (state.kind[slots] == ActorKind.WALKER).all()


def test_walkers_stroll_on_the_real_town05_which_has_no_crosswalks(shared):
    town = load_town(shared / "data" / "xodr" / "Town05.xodr", signals="none")
    walk = build_walk_graph(town)
    assert (walk.crosswalk == -1).all()
    assert walk.length_m.sum() > 8000.0  # of 8.7 km of sidewalk
    state = make_state(walkers=60)
    state.seed[...] = 1
    spawn_walkers(state, walk, 1, 60)
    for _ in range(1200):
        state.tick[()] += 1
        walk_on(state, walk, 1, 61, town.signals)
    places = np.column_stack((state.x, state.y, state.z))[1:]
    assert clearances(town.lanes, places).min() >= 0.25 + 0.4 - 1e-6
    assert (state.kind[1:] == ActorKind.WALKER).all()
