"""Presets of observations: Boxes alone, or one vector, the same from every kind of environment."""

from __future__ import annotations

import os

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import FlattenObservation

import di_envs
from di_envs.config import RouteEnvConfig, UnknownOptionError
from di_envs.observation import observation_space
from di_envs.presets import FLAT_LIMIT, Form
from di_envs.prompt_numbers import (
    FLAT_NUMBERS,
    ROUTE_SAMPLES,
    flat_numbers,
    numbers_of,
    prompt_numbers,
    to_route,
    to_route_of_arrays,
)
from di_envs.testing import check_environment
from di_envs.world.kinds import ActorKind

TOY = "DriveInsight-Toy-v1"
PROMPT = observation_space(("prompt",))
QUIET = {"traffic": 3, "walkers": 1, "observations": ("prompt",)}


def a_prompt():
    """A straight road ahead, a car on it 20 m ahead and 3 m to the right, a red light at 10 m."""
    prompt = {name: np.zeros(part.shape, part.dtype) for name, part in PROMPT.items()}
    prompt["command"] = np.int64(3)
    prompt["prompt_present"][:] = 1
    prompt["target_point"][:] = 25.0, -5.0, 0.0
    prompt["routing"][:, 0] = np.arange(1.0, 51.0)
    prompt["routing"][:, 3] = 1.0
    prompt["speed"][0], prompt["speed_history"][:] = 5.0, 4.0
    prompt["obstacles"][0] = 20.0, 3.0, 0.0, 4.5, 2.0, 5.0, -1.0, ActorKind.CAR, 1.0
    prompt["traffic_lights"][0] = 10.0, 0.0, 0.0, 3.0, 1.0
    return prompt


def test_a_box_for_every_entry_with_the_command_as_ones_and_zeros():
    form, prompt = Form(PROMPT, "box"), a_prompt()
    boxes = form.of(prompt)
    assert boxes in form.space
    assert all(type(part) is Box and part.dtype == np.float32 for part in form.space.values())
    assert boxes["command"].tolist() == [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    assert boxes["prompt_present"].tolist() == [1.0] * 9
    for name in PROMPT.keys() - {"command", "prompt_present"}:
        np.testing.assert_array_equal(boxes[name], prompt[name])


def test_what_is_no_prompt_is_a_box_too_and_images_stay_images():
    space = observation_space(("camera", "inertial", "proximity"), cameras="rl")
    boxes = Form(space, "box").space
    assert boxes["gnss"].dtype == boxes["across_line"].dtype == np.float32
    assert boxes["across_line"].shape == (1,)
    assert boxes["camera_front"] == space["camera_front"]


def test_the_vector_is_the_prompt_by_arithmetic():
    form = Form(PROMPT, "flat")
    vector = form.of(a_prompt())
    assert vector in form.space
    assert vector.shape == (64 + 16 * 12 + 8 * 10 + 4 * 7,)
    assert vector[:7].tolist() == [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    assert vector[7:16].tolist() == pytest.approx(
        [0.5, -0.1, 1.0, 0.0, 0.5, 0.4, 0.4, 0.4, 0.4]  # target, speed, speeds before
    )
    second = ROUTE_SAMPLES[1]
    assert vector[20:24].tolist() == pytest.approx([(second + 1.0) / 30.0, 0.0, 0.0, 1.0])
    # x, y over 40 m, ahead, the 20th of 50 points, 3 m of 20 off it; size over 5 m, speed over 10
    car = [0.5, 0.075, 1.0, 0.0, 19 / 50, 0.15, 0.9, 0.4, 0.5, -0.1, 0.0, 1.0]
    assert vector[64:76].tolist() == pytest.approx(car)
    assert not vector[76 : 64 + 16 * 12].any()  # who is not there says nothing
    light = [0.25, 0.0, 1.0, 0.0, 9 / 50, 0.0, 0.0, 0.0, 1.0, 1.0]
    assert vector[256:266].tolist() == pytest.approx(light)
    assert not vector[266:].any()


def test_the_vector_is_taken_apart_into_the_tables_that_it_was_made_of():
    prompt = Form(PROMPT, "box").of(a_prompt())
    numbers = prompt_numbers(prompt, np)
    flat = flat_numbers(numbers, np)
    assert flat.shape == (FLAT_NUMBERS,)
    for name, part in numbers_of(np.stack([flat, 2.0 * flat]))._asdict().items():
        there = getattr(numbers, f"{name}_valid", 1.0)
        expected = getattr(numbers, name) * there
        np.testing.assert_array_equal(part, np.stack([expected, 2.0 * expected]), err_msg=name)


@pytest.mark.parametrize("shape", [(5,), (3, 5), (2, 3, 5)])
def test_places_on_the_route_are_the_same_bits_by_the_kernel_as_by_whole_arrays(shape):
    draws = np.random.default_rng(0)
    x, y = (draws.normal(0.0, 20.0, (*shape, 2)).astype(np.float32)[..., k] for k in range(2))
    routing = draws.normal(0.0, 20.0, (*shape[:-1], 50, 4)).astype(np.float32)
    routing[..., 3] = draws.random((*shape[:-1], 50)) < 0.7
    routing[..., 10, :] = routing[..., 5, :]  # as near: the first one counts
    for by_kernel, by_arrays in zip(
        to_route_of_arrays(x, y, routing), to_route(x, y, routing, np), strict=True
    ):
        np.testing.assert_array_equal(by_kernel, by_arrays)


def test_what_else_there_is_follows_in_the_vector_each_by_its_largest():
    space = observation_space(("prompt", "odometry"))
    odometry = np.array([5e4, -1e5, np.pi], np.float32)
    vector = Form(space, "flat").of({**a_prompt(), "odometry": odometry})
    assert vector[364:].tolist() == [0.5, -1.0, 1.0]
    assert Form(observation_space(("inertial",)), "flat").space.shape == (7 + 3 + 1,)


def test_no_number_of_a_vector_is_beyond_its_bounds():
    most = {name: np.asarray(getattr(part, "high", 1)) for name, part in PROMPT.items()}
    vector = Form(PROMPT, "flat").of({**most, "command": np.int64(6)})
    assert vector.max() == FLAT_LIMIT  # the length of a car of 100 m


@pytest.mark.parametrize("preset", ["box", "flat"])
def test_each_of_several_egos_is_shown_what_it_sees_itself(preset):
    form = Form(PROMPT, preset)
    plain, shown = (
        di_envs.parallel_env(3, suite="toy", preset=chosen, **QUIET) for chosen in (None, preset)
    )
    raw, seen = plain.reset(seed=1)[0], shown.reset(seed=1)[0]
    for throttle in (0.2, 0.9):
        assert list(seen) == ["ego_0", "ego_1", "ego_2"]
        for name, own in seen.items():
            assert data_equivalence(form.of(raw[name]), own, exact=True)
        actions = {name: np.array([throttle, 0.0, 0.0], np.float32) for name in seen}
        raw, seen = plain.step(actions)[0], shown.step(actions)[0]


@pytest.mark.parametrize("preset", ["box", "flat"])
def test_one_world_many_and_several_egos_show_the_same_to_the_bit(preset):
    options = {**QUIET, "preset": preset, "suite": "toy"}
    form = Form(PROMPT, preset)
    plain = di_envs.RouteEnv(**{**options, "preset": None})
    env = di_envs.RouteEnv(**options)
    worlds = di_envs.RouteVectorEnv(
        2, threads=1, autoreset_mode="SameStep", max_episode_steps=2, **options
    )
    egos = di_envs.parallel_env(1, **options)
    route = {"route": 0}
    seen = [
        form.of(plain.reset(seed=5, options=route)[0]),
        env.reset(seed=5, options=route)[0],
        worlds.reset(seed=5, options=route)[0],
        egos.reset(seed=5, options={"routes": [0]})[0]["ego_0"],
    ]
    assert seen[1] in env.observation_space
    assert seen[3] in egos.observation_space("ego_0")
    assert seen[2] in worlds.observation_space
    assert_same(seen)
    action = np.array([0.7, 0.1, 0.0], np.float32)
    for _ in range(2):
        *_, told = stepped = worlds.step(np.stack([action, action]))
        seen = [form.of(plain.step(action)[0]), env.step(action)[0], stepped[0]]
        seen.append(egos.step({"ego_0": action})[0]["ego_0"])
        if "final_obs" in told:
            final = told["final_obs"][0]
            seen[2] = (
                {name: part[None] for name, part in final.items()}
                if preset == "box"
                else (final[None])
            )
        assert_same(seen)
    assert_same([env.observe(), env.observe(), worlds.observe()[:0] if preset == "flat" else {}])


def assert_same(seen):
    """The first is of one world, the third of many, the others of one again."""
    first, second, rows, *others = seen
    for other in (second, *others):
        if isinstance(first, dict):
            assert all(np.array_equal(first[name], other[name]) for name in first)
        else:
            np.testing.assert_array_equal(first, other)
    if isinstance(rows, dict):
        assert all(np.array_equal(first[name], part[0]) for name, part in rows.items())
    elif len(rows):
        np.testing.assert_array_equal(first, rows[0])


@pytest.mark.parametrize("preset", ["box", "flat"])
def test_an_environment_with_a_preset_keeps_every_promise(preset):
    check_environment(lambda: gymnasium.make(TOY, preset=preset, **QUIET), steps=4)


@pytest.mark.filterwarnings("ignore:.*maximum and minimum values are equal")
@pytest.mark.parametrize("preset", [None, "box", "flat"])
def test_gymnasiums_checker_renders_where_there_is_no_display(preset, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    env = gymnasium.make(TOY, preset=preset, **QUIET)
    assert env.unwrapped.metadata["render_modes"] == ["rgb_array"]
    check_env(env.unwrapped)


def test_where_there_is_a_display_a_window_is_offered(monkeypatch):
    monkeypatch.setitem(os.environ, "DISPLAY", ":0")
    env = di_envs.parallel_env(1, suite="toy", **QUIET)
    assert env.metadata["render_modes"] == ["human", "rgb_array"]


def test_boxes_flattened_by_gymnasium_are_of_single_precision():
    env = FlattenObservation(gymnasium.make(TOY, preset="box", **QUIET))
    observation, _ = env.reset(seed=0)
    assert observation.dtype == env.observation_space.dtype == np.float32


def test_gymnasiums_own_vector_environments_take_a_time_of_reset():
    envs = gymnasium.make_vec(
        TOY,
        num_envs=2,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": AutoresetMode.SAME_STEP},
        preset="flat",
        max_episode_steps=1,
        **QUIET,
    )
    envs.reset(seed=0)
    *_, truncated, info = envs.step(np.zeros((2, 3), np.float32))
    assert truncated.all()
    assert info["final_obs"][0].shape == (364,)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"preset": "bxo"}, "did you mean 'box'"),
        ({"observations": "flat"}, r"observations=\('prompt',\), preset='flat'"),
        ({"preset": "flat", "observations": ("prompt", "camera")}, "images do not go into"),
    ],
)
def test_a_refused_preset_says_what_to_write(options, message):
    with pytest.raises(ValueError, match=message):
        RouteEnvConfig(suite="toy", **options)


def test_tags_of_points_do_not_go_into_a_vector():
    space = Dict({"speed": PROMPT["speed"], "lidar_semantic": Box(0, 22, (4,), np.uint8)})
    with pytest.raises(ValueError, match="lidar_semantic holds whole ones"):
        Form(space, "flat")


def test_an_option_of_other_environments_is_what_python_calls_a_type_error():
    # what TorchRL's GymEnv tries first, and takes back at this message
    with pytest.raises(TypeError, match="unexpected keyword argument 'frameskip'"):
        gymnasium.make(TOY, frameskip=1)
    with pytest.raises(UnknownOptionError, match="known: suite"):
        gymnasium.make_vec(TOY, num_envs=2, frameskip=1)


@pytest.mark.filterwarnings("ignore")  # of TorchRL's own
def test_torchrl_makes_our_environments_by_their_ids():
    torchrl = pytest.importorskip("torchrl.envs", reason="docs/learning.md says how to install it")
    env = torchrl.GymEnv(TOY, preset="flat", **QUIET)
    env.set_seed(5)  # which resets it
    plain = gymnasium.make(TOY, preset="flat", **QUIET)
    plain.reset(seed=5)
    np.testing.assert_array_equal(env.reset()["observation"], plain.reset()[0])
    assert env.rollout(3)["observation"].shape == (3, 364)


# ---- several egos, for what makes worlds of them


@pytest.mark.parametrize("preset", ["box", "flat"])
def test_every_ego_has_the_spaces_of_the_others_before_the_first_reset(preset):
    # what SuperSuit asks of an environment that it pads, stacks or makes worlds of
    egos = di_envs.parallel_env(2, suite="toy", preset=preset, **QUIET)
    first, second = egos.possible_agents
    assert egos.observation_space(first) == egos.observation_space(second)
    assert egos.action_space(first) == egos.action_space(second)
    assert egos.observation_space(first) is egos.observation_space(first)
    assert egos.render_mode is None


@pytest.mark.filterwarnings("ignore")  # of SuperSuit's own
def test_supersuit_pads_stacks_and_makes_worlds_of_several_egos():
    supersuit = pytest.importorskip("supersuit", reason="docs/learning.md says how to install it")
    options = {**QUIET, "preset": "flat", "suite": "toy"}
    egos = di_envs.parallel_env(2, **options)
    egos = supersuit.frame_stack_v1(supersuit.black_death_v3(egos), 3)
    worlds = supersuit.pettingzoo_env_to_vec_env_v1(egos)
    worlds = supersuit.concat_vec_envs_v1(worlds, 2)
    seen, _ = worlds.reset(seed=0)
    assert seen.shape == (4, 3 * 364)
    plain, _ = di_envs.parallel_env(2, **options).reset(seed=0)
    np.testing.assert_array_equal(seen[0, -364:], plain["ego_0"])
    after, *_ = worlds.step(np.zeros((4, 3), np.float32))
    np.testing.assert_array_equal(after[:, 364:728], seen[:, 728:])
