"""World edits: what they change, that they begin another future, and what they refuse."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import di_envs
from di_envs.config import WEATHERS
from di_envs.edits.text import EditError
from di_envs.edits.world import (
    ChangeWeather,
    ForceLight,
    MoveActor,
    RemoveActor,
    apply_world_edits,
    read_world_edits,
)
from di_envs.route_env import RouteEnv
from di_envs.town.lanes import LightState
from di_envs.world.kinds import ActorKind

DRIVE = np.array([0.4, 0.0, 0.0], np.float32)
METRES = st.floats(-50.0, 50.0).map(lambda metres: metres + 0.0)
EDITS = st.one_of(
    st.builds(RemoveActor, actor=st.integers(0, 500)),
    st.builds(MoveActor, actor=st.integers(0, 500), ahead_m=METRES, right_m=METRES),
    st.builds(
        ForceLight,
        light=st.integers(0, 80),
        state=st.sampled_from(("none", "green", "yellow", "red")),
    ),
    st.builds(ChangeWeather, weather=st.sampled_from(WEATHERS)),
)


@pytest.fixture(scope="module")
def env():
    return RouteEnv(
        suite="town05_tiny", observations=("prompt",), traffic=40, walkers=20, control_dt_s=0.1
    )


def driven(env, steps=20):
    env.reset(seed=3, options={"route": 0})
    for _ in range(steps):
        env.step(DRIVE)
    return env


def first(env, *kinds):
    """The first actor of some kinds, outside junctions if it is a vehicle."""
    state, lanes = env.view.state, env.view.town.lanes
    for actor in range(1, state.kind.size):
        if state.kind[actor] in kinds:
            lane = int(state.lane[actor])
            if lane < 0 or (lanes.junction[lane] < 0 and state.lane_m[actor] > 20.0):
                return actor
    raise AssertionError("nobody of that kind")


def future(env, steps=30):
    """Everybody's places over some steps, without the ego."""
    rows = []
    for _ in range(steps):
        env.step(DRIVE)
        state = env.view.state
        rows.append(np.stack([state.x, state.y, state.kind], axis=1)[1:].copy())
    return np.array(rows)


@given(edit=EDITS)
def test_an_edit_survives_the_way_through_its_text(edit):
    assert read_world_edits(str(edit.to_text())) == (edit,)


def test_no_edit_leaves_the_future_as_it_was(env):
    driven(env)
    snapshot = di_envs.save(env)
    untouched = future(env)
    di_envs.restore(env, snapshot)
    apply_world_edits(env, read_world_edits(""))
    assert np.array_equal(untouched, future(env))


def test_a_removed_actor_is_gone_and_seen_no_more(env):
    driven(env)
    actor = first(env, ActorKind.CAR)
    apply_world_edits(env, [RemoveActor(actor=actor)])
    assert env.view.state.kind[actor] == ActorKind.ABSENT
    assert (future(env)[:, actor - 1, 2] == ActorKind.ABSENT).all()


def test_a_vehicle_is_moved_along_its_lane(env):
    driven(env)
    actor, state = first(env, ActorKind.CAR, ActorKind.VAN), env.view.state
    before = float(state.x[actor]), float(state.y[actor])
    yaw = float(state.yaw[actor])
    apply_world_edits(env, [MoveActor(actor=actor, ahead_m=-6.0)])
    dx, dy = float(state.x[actor]) - before[0], float(state.y[actor]) - before[1]
    assert dx * math.cos(yaw) + dy * math.sin(yaw) == pytest.approx(-6.0, abs=0.3)
    assert np.isfinite(future(env)).all()


def test_a_walker_is_moved_along_its_way(env):
    driven(env)
    actor, state = first(env, ActorKind.WALKER), env.view.state
    before = float(state.x[actor]), float(state.y[actor])
    apply_world_edits(env, [MoveActor(actor=actor, ahead_m=3.0)])
    moved = math.hypot(float(state.x[actor]) - before[0], float(state.y[actor]) - before[1])
    assert 1.0 < moved < 5.0
    assert np.isfinite(future(env)).all()


def test_a_forced_light_shows_its_colour_until_it_is_given_back(env):
    driven(env)
    state = env.view.state
    light = int(np.flatnonzero(state.light == LightState.GREEN)[0])
    turn = state.light.copy()
    apply_world_edits(env, [ForceLight(light=light, state="red")])
    assert state.light[light] == LightState.RED
    env.step(DRIVE)
    assert state.light[light] == LightState.RED
    apply_world_edits(env, [ForceLight(light=light, state="none")])
    assert state.light[light] == turn[light]


def test_other_weather_is_seen_until_the_next_reset_and_saved_with_the_rest():
    env = RouteEnv(suite="toy", observations=("camera",), cameras="rl", traffic=0, walkers=0)
    clear, _ = env.reset(seed=0, options={"route": 0})
    apply_world_edits(env, [ChangeWeather(weather="HardRainNight")])
    night = env.observe()
    assert night["camera_front"].mean() < 0.7 * clear["camera_front"].mean()
    snapshot = di_envs.save(env)
    again, _ = env.reset(seed=0, options={"route": 0})
    assert np.array_equal(again["camera_front"], clear["camera_front"])
    di_envs.restore(env, snapshot)
    assert np.array_equal(env.observe()["camera_front"], night["camera_front"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("remove:actr=1", "Unknown world edit 'remove:actr'; did you mean 'remove:actor'"),
        ("remove:actor=1,p=2", "has no settings"),
        ("remove:actor", "needs a whole number, such as remove:actor=17"),
        ("move:actor=1,ahed=2", "Unknown setting of move:actor 'ahed'; did you mean 'ahead'"),
        ("force:light=1", "add ,state=red"),
        ("force:light=1,state=rad", "Unknown state of a light 'rad'; did you mean 'red'"),
        ("change:weather=HardRain", "Unknown weather 'HardRain'; did you mean"),
        ("remove:actor=1@t>5", "leave out @t>5"),
    ],
)
def test_a_wrong_edit_is_refused_with_what_to_write(text, message):
    with pytest.raises(EditError) as error:
        read_world_edits(text)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("remove:actor=0", "is the ego"),
        ("remove:actor=9999", "there is no actor 9999 at this moment; nearest to the ego: "),
        ("force:light=999,state=red", "there is no light 999 in this town; nearest to the ego: "),
        ("move:actor=0,ahead=5", "actor 0 cannot be moved"),
        ("move:actor=1,ahead=5000", "no lane outside junctions leads the way of actor 1"),
    ],
)
def test_an_edit_that_cannot_be_made_says_why(env, text, message):
    driven(env, 1)
    with pytest.raises(EditError) as error:
        apply_world_edits(env, read_world_edits(text))
    assert message in str(error.value)


def test_nobody_is_set_down_in_somebody_else(env):
    driven(env)
    state, lanes = env.view.state, env.view.town.lanes
    lane, cars = state.lane, range(1, 41)
    actor, other = next(
        (a, b)
        for a in cars
        for b in cars
        if a != b and lane[a] == lane[b] and lanes.junction[lane[a]] < 0
        if math.cos(state.yaw[a] - state.yaw[b]) > 0.9
    )
    place = state.x[other] - state.x[actor], state.y[other] - state.y[actor]
    cos, sin = math.cos(state.yaw[actor]), math.sin(state.yaw[actor])
    onto = MoveActor(
        actor=actor,
        ahead_m=cos * place[0] + sin * place[1],
        right_m=cos * place[1] - sin * place[0],
    )
    before = [array[actor].copy() for array in (state.x, state.y, state.lane_m, state.path)]
    with pytest.raises(EditError, match=f"would stand in actor {other} there"):
        apply_world_edits(env, [onto])
    after = [array[actor] for array in (state.x, state.y, state.lane_m, state.path)]
    assert all(np.array_equal(x, y) for x, y in zip(before, after, strict=True))
