"""One pedal and waypoints in place of throttle, steer and brake."""

from __future__ import annotations

import math

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import RescaleAction

import di_envs
from di_envs.actions.forms import FORMS, form_of, pedal_to_control, rescaled
from di_envs.testing import check_environment
from wrappers.actions import PedalWrapper, WaypointWrapper, pedal_vector
from wrappers.vectors import VectorObservations

TOY = "DriveInsight-Toy-v1"


def toy(**options):
    return gymnasium.make(TOY, **{"observations": ("prompt",), "traffic": 4, **options})


def ahead(speed_mps):
    """Waypoints of a straight drive."""
    return np.array([[0.5 * speed_mps * (i + 1), 0.0] for i in range(8)], np.float32)


def test_a_pedal_is_throttle_above_zero_and_brake_below():
    assert pedal_to_control([0.6, -0.2]).tolist() == pytest.approx([0.6, -0.2, 0.0])
    assert pedal_to_control([-0.6, 0.2]).tolist() == pytest.approx([0.0, 0.2, 0.6])
    assert pedal_to_control([0.0, 1.0]).tolist() == [0.0, 1.0, 0.0]


def test_many_pedals_at_once_are_each_by_itself():
    rows = np.array([[1.0, 0.0], [-1.0, -1.0]], np.float32)
    assert pedal_to_control(rows).tolist() == [[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]]


def test_three_numbers_are_no_pedal_action():
    with pytest.raises(ValueError, match="pedal, steer"):
        pedal_to_control([0.0, 0.0, 0.0])


@pytest.mark.parametrize("bad", [np.nan, 1.5])
def test_the_environment_still_refuses_what_no_control_can_be(bad):
    env = PedalWrapper(toy())
    env.reset(seed=0)
    with pytest.raises(ValueError, match="throttle"):
        env.step(np.array([bad, 0.0], np.float32))


def test_a_pedal_drives_as_its_control_does():
    plain, pedal = toy(), PedalWrapper(toy())
    plain.reset(seed=3), pedal.reset(seed=3)
    for value in (0.7, 0.7, -0.3):
        control = np.array([max(value, 0.0), 0.1, max(-value, 0.0)], np.float32)
        expected = plain.step(control)
        got = pedal.step(np.array([value, 0.1], np.float32))
        assert got[1] == expected[1]
        np.testing.assert_array_equal(got[0]["obstacles"], expected[0]["obstacles"])


def test_a_vector_of_environments_takes_pedals():
    envs = pedal_vector(
        gymnasium.make_vec(TOY, num_envs=2, threads=1, observations=("prompt",), traffic=4)
    )
    assert envs.action_space.shape == (2, 2)
    envs.reset(seed=3)
    single = PedalWrapper(toy())
    single.reset(seed=4)
    for _ in range(5):
        batched = envs.step(np.array([[-1.0, 0.0], [0.7, 0.0]], np.float32))
        alone = single.step(np.array([0.7, 0.0], np.float32))
    assert batched[0]["speed"][0, 0] == 0.0
    assert batched[0]["speed"][1, 0] == alone[0]["speed"][0] > 0.5
    envs.close()


def test_waypoints_are_driven_to_at_their_speed():
    env = WaypointWrapper(toy(traffic=0, walkers=0))
    observation, _ = env.reset(seed=0)
    for _ in range(60):
        observation, _, terminated, truncated, _ = env.step(ahead(5.0))
        if terminated or truncated:
            break
    assert observation["speed"][0] == pytest.approx(5.0, abs=0.8)


def test_waypoints_to_the_right_turn_the_ego_right():
    right, left = WaypointWrapper(toy(traffic=0)), WaypointWrapper(toy(traffic=0))
    turned = {}
    for name, env, side in (("right", right, 1.0), ("left", left, -1.0)):
        env.reset(seed=0)
        begin = float(env.unwrapped.view.state.yaw[0])
        for _ in range(20):
            env.step(ahead(4.0) + np.array([0.0, 0.3 * side], np.float32))
        end = float(env.unwrapped.view.state.yaw[0])
        turned[name] = math.remainder(end - begin, 2.0 * math.pi)
    assert turned["right"] > 0.05
    assert turned["left"] < -0.05


@pytest.mark.parametrize("wrapper", [PedalWrapper, WaypointWrapper])
def test_a_wrapped_environment_keeps_every_promise_of_ours(wrapper):
    check_environment(lambda: wrapper(toy()), steps=30)


def test_a_branch_has_the_controllers_past_errors():
    env, twin = WaypointWrapper(toy()), WaypointWrapper(toy())
    env.reset(seed=1)
    for speed in (2.0, 6.0, 4.0):
        env.step(ahead(speed))
    here = di_envs.save(env)
    expected = [env.step(ahead(5.0))[0]["speed"][0] for _ in range(10)]
    assert env.save_state()[0].speed != here.layers[0][1][0].speed  # it has moved on
    twin.reset(seed=9)
    di_envs.restore(twin, here)
    assert [twin.step(ahead(5.0))[0]["speed"][0] for _ in range(10)] == expected


def test_waypoints_need_a_speed_in_metres_a_second():
    with pytest.raises(ValueError, match="group 'prompt'"):
        WaypointWrapper(toy(observations=("camera",), cameras="rl"))
    with pytest.raises(ValueError, match="outside of this one"):
        WaypointWrapper(VectorObservations(toy()))


def test_the_shape_of_an_action_space_tells_its_form():
    for name, space in FORMS.items():
        assert form_of(space) == name
    with pytest.raises(ValueError, match="waypoints"):
        form_of(gymnasium.spaces.Discrete(9))


def test_an_action_in_other_bounds_is_stretched_as_gymnasium_does():
    small = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
    env = RescaleAction(toy(), np.float32(-1.0), np.float32(1.0))
    for action in ([0.0, 0.0, 0.0], [-1.0, 0.25, 1.0], [1.0, -1.0, -0.5]):
        expected = env.action(np.array(action, np.float32))
        np.testing.assert_allclose(rescaled(action, small, "control"), expected, atol=1e-6)
    assert rescaled([0.5, 0.1], FORMS["pedal"], "pedal").tolist() == pytest.approx([0.5, 0.1])
