"""Situations read off prompts that were laid out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from agents.explain.situations import SITUATIONS, situations_of
from di_envs.prompt import empty_prompt

QUARTER = np.pi / 2.0


def straight(points=50):
    """A route straight ahead, a point a metre."""
    routing = np.zeros((50, 4))
    routing[:points, 0] = np.arange(1, points + 1)
    routing[:points, 3] = 1.0
    return routing


def prompt(**parts):
    empty = empty_prompt()._asdict()
    return {**empty, "routing": straight(), **parts}


def car(x, y, yaw=0.0):
    rows = np.zeros((32, 9))
    rows[0] = (x, y, yaw, 4.0, 2.0, 0.0, 0.0, 2.0, 1.0)
    return rows


def line(x, y, yaw=0.0, columns=5):
    rows = np.zeros((8, columns))
    rows[0, :3] = (x, y, yaw)
    rows[0, -1] = 1.0
    return rows


def holding(seen, junction_m=100.0):
    found = situations_of(seen, junction_m)
    assert tuple(found) == SITUATIONS
    return {name for name, holds in found.items() if holds}


def test_an_empty_straight_road_is_free():
    assert holding(prompt()) == {"free"}


def test_shortly_before_a_junction_the_road_is_not_free():
    assert holding(prompt(), junction_m=20.0) == set()
    assert holding(prompt(), junction_m=0.0) == {"junction"}


@pytest.mark.parametrize(
    ("obstacles", "there"),
    [
        (car(10.0, 0.0), True),
        # its side is at 1.4 m, and the ego's with half a metre to spare at 1.5 m
        (car(10.0, 2.4), True),
        (car(10.0, 2.6), False),
        # the route's 20th point is at 20 m, the car's rear at 21.4 m and at 21.6 m
        (car(23.4, 0.0), True),
        (car(23.6, 0.0), False),
        # across the road its half length counts: 3.4 - 2.0 = 1.4 m
        (car(10.0, 3.4, QUARTER), True),
        (car(-10.0, 0.0), False),
    ],
)
def test_an_obstacle_is_what_reaches_into_the_way_ahead(obstacles, there):
    assert ("obstacle" in holding(prompt(obstacles=obstacles))) == there


@pytest.mark.parametrize(
    ("signals", "there"),
    [
        (line(20.0, 0.0), True),
        (line(27.1, 0.0), False),  # further than the 25th point and 2 m
        (line(20.0, 2.5), False),  # the next lane's
        (line(20.0, 0.0, QUARTER), False),  # of the road across
        (line(-1.0, 0.0), False),  # passed
    ],
)
def test_a_light_is_ones_own_if_its_line_is_on_the_route_ahead(signals, there):
    assert ("light" in holding(prompt(traffic_lights=signals))) == there


def test_a_stop_sign_is_no_light():
    assert holding(prompt(stop_signs=line(10.0, 0.0, columns=4)[:4])) == {"stop_sign"}


def test_a_bend_of_twenty_degrees_within_twelve_metres_is_a_turn():
    routing = straight()
    routing[:, 2] = np.deg2rad(np.minimum(np.arange(50) * 1.9, 90.0))  # 11 gaps: 20.9 degrees
    assert "turning" in holding(prompt(routing=routing))
    routing[:, 2] = np.deg2rad(np.arange(50) * 1.7)  # 18.7 degrees
    assert "turning" not in holding(prompt(routing=routing))


def test_an_angle_that_wraps_is_no_turn():
    routing = straight()
    routing[:, 2] = np.where(np.arange(50) % 2, np.pi - 0.01, -np.pi + 0.01)
    assert "turning" not in holding(prompt(routing=routing))


def test_behind_the_routes_end_nothing_is_on_it():
    assert holding(prompt(routing=np.zeros((50, 4)), obstacles=car(5.0, 0.0))) == {"free"}
