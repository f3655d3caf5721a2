"""A stop sign is for the lanes that it rules: small maps, right-hand, left-hand, turned."""

import math

import numpy as np
import pytest

from di_envs.town.queries import pose_at
from di_envs.world.bodies import EgoNow
from di_envs.world.events.stop_sign import detect_stop_sign
from di_envs.world.state import EventKind
from tests.di_envs.town.small_maps import (
    crossing,
    lane,
    left_handed,
    load,
    opendrive,
    road,
    section,
)
from tests.di_envs.town.test_signals import sidecar
from tests.di_envs.world.small_world import make_state, rows

INTO_9 = '<successor elementType="junction" elementId="9"/>'


def joins(end, road_id, contact):
    return f'<{end} elementType="road" elementId="{road_id}" contactPoint="{contact}"/>'


@pytest.fixture(params=[0.0, 0.4, math.pi / 4, math.pi / 2])
def turned(request):
    """Counter-clockwise turn of the whole map [rad]."""
    return request.param


@pytest.fixture(params=["right", "left"])
def signed_town(request, turned, tmp_path):
    """A crossing of streets of two lanes each way; street 1 alone has a stop sign."""
    text = crossing(2, turned=turned)
    if request.param == "left":
        text = left_handed(text)
    # Street 1 comes from the east and ends 10 m from the origin; y of the world points down.
    at = [10.0 * math.cos(turned), -10.0 * math.sin(turned)]
    path = sidecar(tmp_path, {"junction": "9", "kind": "stop", "arms": [{"at": at}]})
    return load(text, tmp_path, signals=path)


def lanes_of(town, road, inbound):
    """A street's lanes towards the junction, or away from it."""
    index = town.road_names.index(road)
    starts = town.lanes.successor_start
    return [
        int(lane)
        for lane in np.flatnonzero(town.lanes.road == index)
        if (starts[lane + 1] > starts[lane]) == inbound
    ]


def fines(town, first, aside=0.0, stand_at=None):
    """Signs fined on a drive of the lane `first` and of first links onwards, every 0.2 m."""
    state, found, tick, on = make_state(), [], 0, first
    while on >= 0:
        for station in np.arange(0.0, town.lanes.length_m[on], 0.2):
            x, y, z, yaw = pose_at(town.lanes, on, station)
            x, y = x - math.sin(yaw) * aside, y + math.cos(yaw) * aside
            stands = stand_at is not None and abs(station - stand_at) < 0.11
            speed = 0.0 if stands else 10.0
            tick += 1
            now = EgoNow(0, tick, x, y, z, yaw, speed, 2.45, on, station)
            out = rows()
            n = detect_stop_sign(state, town.lanes, town.signals, now, yaw, out, 0)
            found += [(EventKind(int(row[0])), int(row[6])) for row in out[:n]]
        link = town.lanes.successor_start[on]
        ends = link == town.lanes.successor_start[on + 1]
        on = -1 if ends else int(town.lanes.successor[link])
    return found


def test_who_passes_on_a_lane_that_the_sign_rules_is_fined_once(signed_town):
    inbound = lanes_of(signed_town, "1", inbound=True)
    assert len(inbound) == 2
    for own in inbound:
        for aside in (-1.0, 0.0, 1.0):
            assert fines(signed_town, own, aside) == [(EventKind.STOP_SIGN, 0)]


def test_who_stands_before_the_line_is_not_fined(signed_town):
    for own in lanes_of(signed_town, "1", inbound=True):
        stand_at = signed_town.lanes.length_m[own] - 3.0
        assert fines(signed_town, own, stand_at=stand_at) == []


def test_who_comes_the_other_way_or_crosses_is_not_fined(signed_town):
    """In a turned box made parallel to the axes they were, on the other carriageway too."""
    for street in ("2", "3", "4"):
        for own in lanes_of(signed_town, street, inbound=True):
            for aside in (-1.7, 0.0, 1.7):
                assert fines(signed_town, own, aside) == []
    for own in lanes_of(signed_town, "1", inbound=False):
        assert fines(signed_town, own, -1.7) == []


def test_a_sign_whose_lane_is_shorter_than_its_box_fines_too(tmp_path):
    """The last 0.4 m before the junction are a road of their own: a step of the look jumps them."""
    street, stub, way = (
        section(0.0, lane(-1, predecessor=back, successor=on))
        for back, on in ((None, -1), (-1, None), (-1, None))
    )
    text = opendrive(
        road("1", 50.0, street, links=joins("successor", "2", "start")),
        road("2", 0.4, stub, x=50.0, links=joins("predecessor", "1", "end") + INTO_9),
        road("3", 20.0, way, x=50.4, links=joins("predecessor", "2", "end"), junction="9"),
        '<junction id="9"><connection id="0" incomingRoad="2" connectingRoad="3" '
        'contactPoint="start"><laneLink from="-1" to="-1"/></connection></junction>',
    )
    town = load(text, tmp_path, signals=sidecar(tmp_path, {"junction": "9", "kind": "stop"}))
    (last,) = town.signals.stop_lane
    assert town.lanes.length_m[last] == pytest.approx(0.4)
    (start,) = lanes_of(town, "1", inbound=True)
    assert fines(town, start) == [(EventKind.STOP_SIGN, 0)]
