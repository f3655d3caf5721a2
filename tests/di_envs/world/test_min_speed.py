"""The minimum speed of Leaderboard 2.x, by arithmetic: means over a quarter of the route."""

from __future__ import annotations

import numpy as np
import pytest

from di_envs.town.lanes import SignalKind
from di_envs.world.dynamics import locate_ego
from di_envs.world.events.progress import advance_progress
from di_envs.world.events.watching import begin_events, detect_events
from di_envs.world.state import ActorKind, EventKind
from tests.di_envs.world.small_world import (
    make_lanes,
    make_routes,
    make_signals,
    make_state,
    put,
    rows,
)

LANES, SIGNALS, ROUTES = make_lanes(), make_signals(SignalKind.YIELD), make_routes()


class Drive:
    """An ego on a route of 200 m, half a metre a tick, and one vehicle beside it."""

    def __init__(self, vehicles=1):
        self.state, self.vehicles = make_state(vehicles=vehicles), vehicles
        self.events = []

    def go(self, begin, end, speed, pace=10.0, aside=10.0, above=0.0):
        """Drives from `begin` to `end` [m] at `speed`, the vehicle at `pace` [m/s]."""
        state = self.state
        for x in np.arange(begin, end, 0.5):
            state.tick[()] += 1
            state.x[0], state.speed[0] = x, speed
            if self.vehicles:
                put(state, 1, ActorKind.CAR, float(x), aside, speed=pace, z=state.z[0] + above)
            locate_ego(state, LANES, 0)
            advance_progress(state, ROUTES, 0)
            out = rows()
            end_vehicles = 1 + self.vehicles
            n = detect_events(state, LANES, SIGNALS, ROUTES, 0, end_vehicles, out, 0)
            self.events += [(EventKind(int(row[0])), row[7]) for row in out[:n]]
        return [event for event in self.events if event[0] == EventKind.MIN_SPEED]


def test_four_quarters_at_eight_metres_per_second_beside_ten_are_four_events_of_eighty_percent():
    drive = Drive()
    failed = drive.go(0.0, 200.0, speed=8.0)
    assert [kind for kind, _ in drive.events[-2:]] == [EventKind.MIN_SPEED, EventKind.COMPLETED]
    assert [value for _, value in failed] == pytest.approx([80.0] * 4)
    assert drive.state.pace_share[0] == pytest.approx([0.8] * 4)


def test_keeping_up_with_the_traffic_is_no_event():
    drive = Drive()
    assert drive.go(0.0, 200.0, speed=10.0) == []
    assert drive.state.checkpoint[0] == 4


def test_the_mean_is_over_time_since_the_last_checkpoint():
    """Fifty metres at 5 and 10 m/s, then a quarter faster than the traffic."""
    drive = Drive()
    drive.go(0.0, 25.0, speed=5.0)
    failed = drive.go(25.0, 51.0, speed=10.0)
    assert failed == []  # more than 50 m of route points must be passed
    failed = drive.go(51.0, 102.5, speed=12.0)
    assert [value for _, value in failed] == pytest.approx([75.0], abs=1.0)


@pytest.mark.parametrize("where", [{"aside": 50.5}, {"above": 6.0}])
def test_vehicles_far_away_or_on_another_level_set_no_pace(where):
    assert Drive().go(0.0, 200.0, speed=1.0, **where) == []
    assert len(Drive().go(0.0, 200.0, speed=1.0, aside=49.5)) == 4


def test_an_empty_road_and_standing_traffic_set_no_pace():
    assert Drive(vehicles=0).go(0.0, 200.0, speed=1.0) == []
    assert Drive().go(0.0, 200.0, speed=1.0, pace=0.0) == []


def test_a_route_given_up_half_way_is_judged_at_the_checkpoints_it_passed():
    drive = Drive()
    assert len(drive.go(0.0, 110.0, speed=5.0)) == 2
    drive.state.y[0] = 31.0  # off the route
    failed = drive.go(110.0, 110.5, speed=5.0)
    assert drive.events[-1][0] == EventKind.ROUTE_DEVIATION
    assert len(failed) == 2


def test_a_new_route_begins_with_a_clean_pace():
    drive = Drive()
    drive.go(0.0, 120.0, speed=5.0)
    begin_events(drive.state, 0)
    fresh = make_state(vehicles=1)
    for name in ("checkpoint", "pace_share", "pace_from_m", "pace_ego", "pace_traffic"):
        assert np.array_equal(getattr(drive.state, name), getattr(fresh, name)), name
