"""Stable-Baselines3 accepts our environments without a warning, and learns on them."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra rl")
import torch
from gymnasium.wrappers import RescaleAction
from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    VecFrameStack,
    VecMonitor,
    VecNormalize,
)

import di_envs
from di_envs.presets import Form
from wrappers.actions import PedalWrapper, WaypointWrapper, pedal_vector
from wrappers.prompt_features import KEYS, PromptFeatures
from wrappers.sb3 import Sb3VecEnv
from wrappers.vectors import VectorObservations

TOY = "DriveInsight-Toy-v1"
TINY = "DriveInsight-Town05Tiny-v1"


@pytest.fixture(autouse=True)
def one_thread():
    """Threads of torch that outnumber free cores wait for each other most of the time."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def vector(count=3, keys=None, **options):
    options = {"observations": ("prompt",), "traffic": 4, "threads": 1, **options}
    envs = gymnasium.make_vec(TOY, num_envs=count, autoreset_mode="SameStep", **options)
    return Sb3VecEnv(pedal_vector(envs), keys=keys)


@pytest.mark.parametrize("observations", ["rl", ("prompt",)])
@pytest.mark.parametrize("env_id", [TOY, TINY])
def test_the_checker_has_nothing_to_say(env_id, observations):
    # warnings are errors in this suite: one would fail the test
    env = gymnasium.make(env_id, observations=observations)
    check_env(VectorObservations(PedalWrapper(env)))


def test_the_checker_has_nothing_to_say_about_waypoints():
    env = WaypointWrapper(gymnasium.make(TOY, observations=("prompt",)))
    check_env(VectorObservations(RescaleAction(env, np.float32(-1.0), np.float32(1.0))))


def test_ppo_learns_64_steps_on_everything_that_there_is_to_see():
    env = PedalWrapper(gymnasium.make(TOY, traffic=4))
    assert {"camera_back", "lidar", "map"} <= env.observation_space.spaces.keys()
    learner = PPO("MultiInputPolicy", env, n_steps=32, batch_size=32, n_epochs=1, device="cpu")
    learner.learn(64)
    assert learner.num_timesteps == 64


def test_worlds_in_threads_give_what_stable_baselines_own_loop_gives():
    def single():
        return PedalWrapper(gymnasium.make(TOY, observations=("prompt",), traffic=4))

    theirs = DummyVecEnv([single] * 3)
    ours = vector(3, max_episode_steps=12)
    limited = DummyVecEnv([lambda: gymnasium.wrappers.TimeLimit(single(), 12)] * 3)
    theirs.close()
    ours.seed(5), limited.seed(5)
    _same(ours.reset(), limited.reset())
    ends = 0
    for step in range(30):
        actions = np.array([[0.8, 0.3], [0.5, -0.6], [-0.2, step % 2]], np.float32)
        got, expected = ours.step(actions), limited.step(actions)
        _same(got[0], expected[0])
        np.testing.assert_array_equal(got[1], expected[1])
        np.testing.assert_array_equal(got[2], expected[2])
        for index in np.flatnonzero(got[2]):
            ends += 1
            mine, other = got[3][index], expected[3][index]
            _same(mine["terminal_observation"], other["terminal_observation"])
            assert mine["TimeLimit.truncated"] == other["TimeLimit.truncated"] is True
            assert mine["driving_score"] == other["driving_score"]
            assert mine["route_id"] == other["route_id"]
            assert mine["reward_terms"] == other["reward_terms"]
    assert ends == 6
    ours.close()


def _same(got, expected):
    assert got.keys() == expected.keys()
    for name in got:
        np.testing.assert_array_equal(got[name], expected[name], err_msg=name)


def test_a_policy_sees_the_entries_that_it_asks_for():
    envs = vector(2, keys=("speed", "routing"))
    assert set(envs.observation_space.spaces) == {"speed", "routing"}
    assert set(envs.reset()) == {"speed", "routing"}
    assert envs.env_method("observe", indices=1)[0]["map"].shape == (64, 10, 4)
    assert envs.get_attr("route_ids") == [envs.envs.unwrapped.envs[0].route_ids] * 2
    envs.close()


def test_worlds_that_reset_at_another_time_are_refused():
    envs = gymnasium.make_vec(TOY, num_envs=2, threads=1, observations=("prompt",), traffic=4)
    with pytest.raises(ValueError, match="SameStep"):
        Sb3VecEnv(envs)
    envs.close()


def test_ppo_reads_the_prompt_with_our_features_twice_to_the_same_bits():
    def trained():
        worlds = VecMonitor(vector(2, keys=KEYS))
        worlds.seed(0)
        learner = PPO(
            "MultiInputPolicy",
            worlds,
            n_steps=32,
            batch_size=32,
            n_epochs=2,
            policy_kwargs={"features_extractor_class": PromptFeatures},
            seed=0,
            device="cpu",
        )
        learner.learn(128)
        worlds.close()
        return learner.policy.state_dict()

    first, second = trained(), trained()
    assert all(bool((first[name] == second[name]).all()) for name in first)


def test_the_features_are_blind_to_the_order_of_rows_and_to_empty_ones():
    env = di_envs.RouteEnv(suite="town05_tiny", observations=("prompt",))
    observation, _ = env.reset(seed=3)
    torch.manual_seed(0)
    features = PromptFeatures(env.observation_space)

    def of(observation):
        batch = {name: torch.as_tensor(np.asarray(observation[name]))[None] for name in KEYS}
        batch["command"] = torch.nn.functional.one_hot(batch["command"], 7).float()
        return features({name: value.float() for name, value in batch.items()}).detach()

    plain = of(observation)
    assert plain.shape == (1, features.features_dim)
    turned = observation["traffic_lights"][::-1].copy()
    assert observation["traffic_lights"][0, -1] == 1.0  # there is a light to be read
    torch.testing.assert_close(of({**observation, "traffic_lights": turned}), plain)
    junk = observation["obstacles"].copy()
    junk[junk[:, -1] == 0.0, :3] = 7.0
    torch.testing.assert_close(of({**observation, "obstacles": junk}), plain)
    red, green = observation["traffic_lights"].copy(), observation["traffic_lights"].copy()
    red[:, 3], green[:, 3] = 3.0, 1.0
    lit = [of({**observation, "traffic_lights": table}) for table in (red, green)]
    assert not torch.equal(*lit)


def test_the_features_of_the_vector_are_those_of_the_prompt():
    raw = di_envs.RouteEnv(suite="town05_tiny", observations=("prompt",))
    seen, _ = raw.reset(seed=3)
    boxes, flat = (Form(raw.observation_space, preset) for preset in ("box", "flat"))
    torch.manual_seed(0)
    of_prompt, of_vector = PromptFeatures(raw.observation_space), PromptFeatures(flat.space)
    of_vector.load_state_dict(of_prompt.state_dict())
    prompt = {name: torch.as_tensor(part)[None] for name, part in boxes.of(seen).items()}
    vector = torch.as_tensor(flat.of(seen))[None]
    torch.testing.assert_close(of_vector(vector), of_prompt(prompt))
    with pytest.raises(ValueError, match="364 numbers"):
        PromptFeatures(gymnasium.spaces.Box(-1.0, 1.0, (365,)))


def test_stable_baselines_own_wrappers_take_boxes_and_vectors():
    flat = VecNormalize(VecFrameStack(vector(2, preset="flat"), 3))
    assert flat.reset().shape == (2, 3 * 364)
    boxes = VecNormalize(VecFrameStack(vector(2, preset="box"), 3))
    assert boxes.reset()["command"].shape == (2, 3 * 7)
    for worlds in (flat, boxes):
        worlds.step(np.zeros((2, 2), np.float32))
        worlds.close()


@pytest.mark.parametrize("preset", ["box", "flat"])
def test_the_checker_has_nothing_to_say_about_presets(preset):
    env = gymnasium.make(TOY, observations=("prompt",), preset=preset)
    check_env(PedalWrapper(env) if preset == "flat" else VectorObservations(PedalWrapper(env)))
