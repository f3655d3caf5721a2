"""Route progress: what counts as passed, what RC is, and how it stands a route's rough places."""

import numpy as np

from di_envs.world.events.progress import advance_progress, route_completed
from tests.di_envs.world.small_world import make_routes, make_state


def straight(*stations, y=0.0):
    """Route points along x, heading east."""
    return np.array([[x, y, 0.0, 0.0] for x in stations], float)


def visit(state, routes, *places):
    for x, y in places:
        state.x[0], state.y[0] = x, y
        advance_progress(state, routes, 0)


def test_driving_eighty_metres_completes_eighty_metres():
    state, routes = make_state(), make_routes()
    visit(state, routes, *((0.4 * k, 0.0) for k in range(1, 202)))  # 80.4 m
    assert state.route_index[0] == 80
    assert state.route_done_m[0] == 80.0


def test_a_point_is_passed_only_when_it_lies_behind():
    state, routes = make_state(), make_routes()
    visit(state, routes, (1.0, 0.0))
    assert state.route_index[0] == 0
    visit(state, routes, (1.001, 0.0))
    assert state.route_index[0] == 1


def test_two_points_a_tick_are_looked_at_and_no_more():
    state, routes = make_state(), make_routes()
    visit(state, routes, (50.0, 0.0))
    assert state.route_index[0] == 2
    visit(state, routes, (50.0, 0.0))
    assert state.route_index[0] == 4


def test_there_is_no_limit_to_the_side():
    state, routes = make_state(), make_routes()
    visit(state, routes, (2.5, 500.0))
    assert state.route_index[0] == 2


def test_progress_never_goes_back():
    state, routes = make_state(), make_routes()
    visit(state, routes, (1.5, 0.0), (-30.0, 0.0))
    assert (state.route_index[0], state.route_done_m[0]) == (1, 1.0)


def test_a_lateral_jump_of_a_lane_change_is_passed_and_its_metres_count():
    points = np.concatenate((straight(0, 1, 2), straight(2, 3, 4, y=3.5)))
    state, routes = make_state(), make_routes(points)
    visit(state, routes, *((0.25 * k, 0.0) for k in range(1, 18)))  # it never changes lane
    assert state.route_index[0] == 5
    assert state.route_done_m[0] == 2.0 + 3.5 + 2.0


def test_backward_steps_where_keypoints_join_do_no_harm():
    points = straight(0, 1, 2, 3, 4, 2.5, 3.5, 4.5, 5.5)
    state, routes = make_state(), make_routes(points)
    visit(state, routes, *((0.25 * k, 0.0) for k in range(1, 24)))
    assert state.route_index[0] == 8
    assert state.route_done_m[0] == 4.0 + 1.5 + 3.0


def test_the_forward_vector_is_the_lane_s_at_the_point():
    points = straight(0, 1, 2)
    points[1:, 3] = np.pi / 2  # the lane turns right (south)
    state, routes = make_state(), make_routes(points)
    visit(state, routes, (5.0, -0.1))
    assert state.route_index[0] == 0
    visit(state, routes, (0.1, 0.1))
    assert state.route_index[0] == 2


def test_the_target_is_the_next_one_not_yet_passed():
    state, routes = make_state(), make_routes()  # targets at points 50, 100, 150, 200
    assert list(routes.target) == [50, 100, 150, 200]
    state.route_index[0] = 49
    visit(state, routes, (50.0, 0.0))
    assert state.target_index[0] == 0
    visit(state, routes, (50.1, 0.0))
    assert state.target_index[0] == 1
    state.route_index[0] = 199
    visit(state, routes, (300.0, 0.0))
    assert state.target_index[0] == 3  # the last one stays


def test_completion_needs_ninety_nine_per_cent_and_ten_metres():
    routes = make_routes()  # 200 m
    for done, x, expected in ((198.0, 199.0, False), (199.0, 199.0, True), (199.0, 189.9, False)):
        assert route_completed(routes, 0, done, x, 0.0, 0.0) == expected


def test_the_end_on_a_bridge_is_not_reached_from_below():
    points = straight(*range(201))
    points[:, 2] = 10.0
    routes = make_routes(points)
    assert not route_completed(routes, 0, 200.0, 199.5, 0.0, 0.0)
    assert route_completed(routes, 0, 200.0, 199.5, 0.0, 10.0)


def test_a_finished_route_makes_no_more_progress():
    state, routes = make_state(), make_routes()
    state.finished[0] = 9
    visit(state, routes, (1.5, 0.0))
    assert state.route_index[0] == 0
