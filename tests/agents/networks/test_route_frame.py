"""Where rows lie along a route, by arithmetic that can be redone on paper."""

from __future__ import annotations

import math

import pytest
import torch

from agents.networks.route_frame import ROUTE_COLUMNS, along_route, next_on_route, on_route


def straight(points=50):
    """A route straight ahead, its first point a metre ahead of the ego."""
    route = torch.zeros(1, points, 4)
    route[0, :, 0] = torch.arange(1, points + 1)
    route[0, :, 3] = 1.0
    return route


def seen(route, pose, velocity=None):
    rows = torch.tensor([[pose]])
    moves = None if velocity is None else torch.tensor([[velocity]])
    return along_route(on_route(route, rows, moves))[0, 0].tolist()


def test_a_car_on_the_route_is_told_by_its_station_and_its_speed_along_it():
    # 11 m ahead is 10 m from the first point; it comes towards the ego at 5 m/s
    station, aside, close, cos, sin, along, across, told = seen(
        straight(), (11.0, 0.0, math.pi), (-5.0, 0.0)
    )
    assert station == pytest.approx(10.0 / 20.0)
    assert (aside, close, told) == (0.0, 1.0, 1.0)
    assert (cos, sin) == pytest.approx((-1.0, 0.0), abs=1e-6)
    assert (along, across) == pytest.approx((-0.5, 0.0))


def test_a_car_beside_the_route_is_told_how_far_and_how_fast_it_comes():
    # 3 m to the right, moving to the left at 2 m/s: across the route, away from the right
    _, aside, close, *_, along, across, _ = seen(straight(), (8.4, 3.0, 0.0), (0.0, -2.0))
    assert aside == pytest.approx(3.0 / 5.0)
    assert close == pytest.approx(math.exp(-math.hypot(0.4, 3.0) / 3.0))
    assert (along, across) == pytest.approx((0.0, -0.2))


def test_round_a_bend_it_is_the_routes_way_that_counts():
    # ten points ahead, then to the right: the 15th lies at (10, 5), heading right
    route = straight(20)
    for n in range(10, 20):
        route[0, n, :3] = torch.tensor([10.0, n - 9.0, math.pi / 2])
    station, aside, _, cos, sin, along, across, _ = seen(route, (12.0, 5.0, 0.0), (3.0, 0.0))
    assert station == pytest.approx(14.0 / 20.0, abs=1e-6)
    assert aside == pytest.approx(-2.0 / 5.0)  # to the left of who drives to the right
    assert (cos, sin) == pytest.approx((0.0, -1.0), abs=1e-6)
    assert (along, across) == pytest.approx((0.0, -0.3), abs=1e-6)


def test_beyond_the_last_point_and_before_the_first_the_route_goes_on_straight():
    route = straight(10)
    assert seen(route, (25.0, 0.0, 0.0))[0] == pytest.approx(24.0 / 20.0)
    assert seen(route, (-3.0, 0.0, 0.0))[0] == pytest.approx(-4.0 / 20.0)


def test_points_that_are_not_there_count_for_nothing_and_without_any_all_is_zero():
    route = straight(20)
    route[0, 10:, 3] = 0.0
    assert seen(route, (15.0, 0.0, 0.0)) == pytest.approx(seen(straight(10), (15.0, 0.0, 0.0)))
    route[0, :, 3] = 0.0
    assert seen(route, (15.0, 2.0, 0.3), (4.0, 1.0)) == [0.0] * ROUTE_COLUMNS


def come_to(route, poses, presence=None, *, same_way=False):
    """The place of the row that comes next among rows at these poses, x and y."""
    rows = torch.tensor([poses])
    there = torch.ones(1, len(poses)) if presence is None else torch.tensor([presence])
    return next_on_route(on_route(route, rows), there, rows, same_way=same_way)[0, :2].tolist()


def test_what_comes_next_is_the_nearest_row_ahead_that_lies_on_the_route():
    behind, beside, near, far = (-4.0, 0.0, 0.0), (5.0, 3.5, 0.0), (9.0, 0.5, 0.0), (20.0, 0.0, 0.0)
    assert come_to(straight(), [far, near, beside, behind]) == [9.0, 0.5]
    # somebody who is hardly seen is not come to, nor is anybody without a route
    assert come_to(straight(), [far, near], [1.0, 0.1]) == [20.0, 0.0]
    nowhere = straight()
    nowhere[..., 3] = 0.0
    assert come_to(nowhere, [far, near]) == [0.0, 0.0]
    assert come_to(straight(), [behind, beside]) == [0.0, 0.0]


def test_a_line_across_the_way_is_nobodys_own():
    across, own = (9.0, 0.5, math.pi / 2), (20.0, 0.0, 0.1)
    assert come_to(straight(), [across, own], same_way=True) == [20.0, 0.0]
    assert come_to(straight(), [across, own]) == [9.0, 0.5]
