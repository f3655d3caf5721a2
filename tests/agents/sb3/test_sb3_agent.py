"""Models of Stable-Baselines3 drive: what they need is read off them, and what is wrong is said."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile

import gymnasium
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra rl")
from gymnasium.wrappers import (
    FilterObservation,
    FlattenObservation,
    RescaleAction,
    TransformObservation,
)
from stable_baselines3 import A2C, DDPG, DQN, PPO, SAC, TD3

from agents import AgentSpecError, load_agent
from agents.base import Track
from leaderboard.running.driver import Driver
from leaderboard.running.jobs import Job, RunSpec
from wrappers.actions import PedalWrapper, WaypointWrapper
from wrappers.vectors import VectorObservations

TOY = "DriveInsight-Toy-v1"
SMALL = {"net_arch": [8]}


def toy(**options):
    options = {"observations": ("prompt",), "traffic": 4, **options}
    return FilterObservation(gymnasium.make(TOY, **options), KEYS)


KEYS = ["speed", "routing", "command"]


def saved(path, algorithm, env, steps=0, **options):
    """A small model, trained for a few steps, and its specification."""
    model = algorithm(
        "MultiInputPolicy", env, policy_kwargs=dict(SMALL), seed=0, device="cpu", **options
    )
    if steps:
        model.learn(steps)
    model.save(path)
    return model, f"sb3:{path}"


def ppo(path, env, steps=0, **told):
    model, spec = saved(path, PPO, env, steps, n_steps=16, batch_size=16, n_epochs=1)
    if told:
        model.driveinsight_options = told
        model.save(path)
    return model, spec


def test_a_trained_model_is_scored_and_drives_as_it_does_in_its_own_environment(tmp_path):
    env = VectorObservations(PedalWrapper(toy()))
    model, spec = ppo(tmp_path / "ppo.zip", env, steps=32)
    with Driver(RunSpec(agent=spec, options={"suite": "toy", "traffic": 4})) as driver:
        job = Job(index=0, route_id=driver.env.route_ids[0], seed=0)
        first, second = driver.drive(job), driver.drive(job)
    assert first.reason == ""
    assert first.observation_hash == second.observation_hash
    observation, _ = env.reset(seed=job.world_seed, options={"route": job.route_id})
    total, over, steps = 0.0, False, 0
    while not over:
        action, _ = model.predict(observation, deterministic=True)
        observation, reward, terminated, truncated, info = env.step(action)
        total, over, steps = total + reward, terminated or truncated, steps + 1
    assert steps == first.steps
    assert info["driving_score"] == pytest.approx(first.score.driving_score, abs=1e-6)


def test_what_a_model_needs_is_read_off_its_spaces(tmp_path):
    _, spec = ppo(tmp_path / "prompt.zip", PedalWrapper(toy()))
    needs = load_agent(spec).requires
    assert (needs.observations, needs.control_dt_s) == (("prompt",), 0.1)
    assert needs.track == Track.PROMPT

    env = PedalWrapper(gymnasium.make(TOY, observations="rl", traffic=4))
    _, spec = ppo(tmp_path / "camera.zip", FilterObservation(env, ["camera_front", "speed"]))
    needs = load_agent(spec).requires
    assert needs.observations == ("prompt", "camera")
    assert dict(needs.options) == {"cameras": "rl"}
    assert needs.track == Track.SENSORS

    env = gymnasium.make(TOY, observations=("lidar",), lidar="paper", traffic=4)
    _, spec = ppo(tmp_path / "lidar.zip", VectorObservations(env))
    needs = load_agent(spec).requires
    assert (needs.observations, dict(needs.options)) == (("lidar",), {"lidar": "paper"})


def test_a_model_says_how_long_an_action_is_held(tmp_path):
    _, spec = ppo(tmp_path / "slow.zip", PedalWrapper(toy(control_dt_s=0.2)), control_dt_s=0.2)
    assert load_agent(spec).requires.control_dt_s == 0.2
    assert load_agent(f"{spec}?control_dt_s=0.5").requires.control_dt_s == 0.5


@pytest.mark.parametrize("algorithm", [PPO, A2C, SAC, TD3, DDPG])
def test_each_algorithm_for_continuous_actions_is_told_from_its_file(tmp_path, algorithm):
    env = VectorObservations(PedalWrapper(toy()))
    options = {"buffer_size": 10} if algorithm in (SAC, TD3, DDPG) else {}
    model, spec = saved(tmp_path / "model.zip", algorithm, env, **options)
    agent = load_agent(spec)
    observation, _ = env.reset(seed=0)
    raw = env.unwrapped.observe()
    action, _ = model.predict(observation, deterministic=True)
    control, _ = agent.act(raw, agent.start(env.unwrapped.plan, 0))
    assert control.tolist() == [max(action[0], 0.0), action[1], max(-action[0], 0.0)]


@pytest.mark.parametrize("scaled", [False, True])
def test_waypoints_are_followed_as_by_the_wrapper(tmp_path, scaled):
    waypoints = WaypointWrapper(toy())
    one = np.float32(1.0)
    env = RescaleAction(waypoints, -one, one) if scaled else waypoints
    model, spec = ppo(tmp_path / "waypoints.zip", env)
    agent = load_agent(spec)
    observation, _ = env.reset(seed=2)
    memory = agent.start(env.unwrapped.plan, 2)
    for _ in range(6):
        action, _ = model.predict(observation, deterministic=True)
        control, memory = agent.act(env.unwrapped.observe(), memory)
        inner = env.action(action) if scaled else action
        before = waypoints.save_state()
        np.testing.assert_allclose(control, waypoints.action(inner), atol=1e-3)
        waypoints.restore_state(before)
        observation, *_ = env.step(action)


def test_the_direct_control_needs_no_translation(tmp_path):
    model, spec = ppo(tmp_path / "direct.zip", toy())
    agent = load_agent(spec)
    env = toy()
    observation, _ = env.reset(seed=0)
    action, _ = model.predict(observation, deterministic=True)
    control, _ = agent.act(env.unwrapped.observe(), agent.start(env.unwrapped.plan, 0))
    np.testing.assert_array_equal(control, action)


def preset_toy(**options):
    options = {"observations": ("prompt",), "traffic": 4, **options}
    return PedalWrapper(gymnasium.make(TOY, **options))


def in_one_vector(env):
    """A small model of one vector, saved."""
    return PPO(
        "MlpPolicy",
        env,
        n_steps=16,
        batch_size=16,
        policy_kwargs=dict(SMALL),
        seed=0,
        device="cpu",
    )


FORMS = {
    "flat": lambda: preset_toy(preset="flat"),
    "flattened": lambda: FlattenObservation(preset_toy()),
    "flattened boxes": lambda: FlattenObservation(preset_toy(preset="box")),
    "flattened vectors": lambda: FlattenObservation(VectorObservations(preset_toy())),
    "with odometry": lambda: preset_toy(preset="flat", observations=("prompt", "odometry")),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_model_of_one_vector_sees_here_what_it_learned_on(tmp_path, form):
    env = FORMS[form]()
    model = in_one_vector(env)
    model.save(tmp_path / "model.zip")
    agent = load_agent(f"sb3:{tmp_path / 'model.zip'}")
    groups = ("prompt", "odometry") if form == "with odometry" else ("prompt",)
    assert agent.requires.observations == groups
    expected = "flat" if "with" in form else {"flattened boxes": "box"}.get(form, form)
    assert agent.requires.preset == (expected if expected in ("flat", "box") else "")
    assert_drives_like(agent, model, env, observations=groups)


def assert_drives_like(agent, model, env, **options):
    """The agent, shown what there is as it is, does what the model does on its own environment."""
    raw = preset_toy(**options)
    observation, _ = env.reset(seed=1, options={"route": 0})
    as_it_is, _ = raw.reset(seed=1, options={"route": 0})
    memory, state = agent.start(raw.unwrapped.plan, 1), None
    for _ in range(3):
        action, state = model.predict(observation, state=state, deterministic=True)
        control, memory = agent.act(as_it_is, memory)
        assert control.tolist() == [max(action[0], 0.0), action[1], max(-action[0], 0.0)]
        observation, *_ = env.step(action)
        as_it_is, *_ = raw.step(action)


def test_a_model_of_boxes_drives_and_its_run_keeps_the_preset(tmp_path):
    env = preset_toy(preset="box")
    model, spec = ppo(tmp_path / "boxes.zip", env, preset="box")
    agent = load_agent(spec)
    assert agent.requires.preset == "box"
    assert_drives_like(agent, model, env)
    kept = agent.requires.as_json()
    assert kept["preset"] == "box"
    assert type(agent.requires).of_json(kept) == agent.requires
    assert "preset" not in load_agent("constant").requires.as_json()  # as in older records


def test_what_a_model_says_of_its_preset_must_be_what_its_space_is(tmp_path):
    model = in_one_vector(FORMS["flat"]())
    model.driveinsight_options = {"preset": "box"}
    model.save(tmp_path / "wrong.zip")
    assert "preset='box', but its observation space is that of preset='flat'" in refusal(
        f"sb3:{tmp_path / 'wrong.zip'}"
    )


def test_a_vector_of_chosen_entries_is_refused_with_what_there_is(tmp_path):
    in_one_vector(FlattenObservation(PedalWrapper(toy()))).save(tmp_path / "some.zip")
    message = refusal(f"sb3:{tmp_path / 'some.zip'}")
    assert "(208,)" in message  # speed, 50 points of 4, a command of 7
    assert "train it on preset='flat'" in message
    assert "(364,)" in message


@pytest.mark.parametrize("algorithm", ["RecurrentPPO", "TQC", "CrossQ"])
def test_models_of_sb3_contrib_drive_and_a_recurrent_one_remembers_in_its_memory(
    tmp_path, algorithm
):
    contrib = pytest.importorskip("sb3_contrib", reason="needs the extra rl")
    env = FORMS["flat"]()
    recurrent = algorithm == "RecurrentPPO"
    network = dict(SMALL) | ({"lstm_hidden_size": 8} if recurrent else {})
    settings = {"n_steps": 16, "batch_size": 16} if recurrent else {"buffer_size": 10}
    model = getattr(contrib, algorithm)(
        "MlpLstmPolicy" if recurrent else "MlpPolicy",
        env,
        policy_kwargs=network,
        seed=0,
        device="cpu",
        **settings,
    )
    model.save(tmp_path / "model.zip")
    agent = load_agent(f"sb3:{tmp_path / 'model.zip'}")
    assert_drives_like(agent, model, env)
    seen, _ = preset_toy().reset(seed=1)
    _, memory = agent.act(seen, start := agent.start(None, 0))
    first, _ = agent.act(seen, start)
    second, _ = agent.act(seen, memory)
    assert (first.tolist() != second.tolist()) == recurrent
    assert agent.act(seen, start)[0].tolist() == first.tolist()


def test_without_sb3_contrib_its_models_name_the_cure(tmp_path, monkeypatch):
    data = {"policy_class": {"__module__": "sb3_contrib.tqc.policies"}}
    with zipfile.ZipFile(tmp_path / "tqc.zip", "w") as archive:
        archive.writestr("data", json.dumps(data))
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    assert "needs sb3_contrib: pip install 'driveinsight[rl]'" in refusal(
        f"sb3:{tmp_path / 'tqc.zip'}"
    )


def refusal(spec):
    with pytest.raises(AgentSpecError) as refused:
        load_agent(spec)
    return str(refused.value)


def test_what_is_no_model_is_refused(tmp_path):
    assert "there is no file" in refusal(f"sb3:{tmp_path / 'none.zip'}")
    text = tmp_path / "text.zip"
    text.write_text("not a zip")
    assert "model.save" in refusal(f"sb3:{text}")
    other = tmp_path / "other.zip"
    with zipfile.ZipFile(other, "w") as archive:
        archive.writestr("readme", "hello")
    assert "model.save" in refusal(f"sb3:{other}")
    with zipfile.ZipFile(other, "w") as archive:
        archive.writestr("data", json.dumps({"gamma": 0.9}))
    assert "PPO, SAC, TD3, DQN, A2C, DDPG" in refusal(f"sb3:{other}")


def test_half_a_model_is_refused(tmp_path):
    ppo(tmp_path / "whole.zip", PedalWrapper(toy()))
    half = tmp_path / "half.zip"
    with zipfile.ZipFile(tmp_path / "whole.zip") as whole, zipfile.ZipFile(half, "w") as archive:
        archive.writestr("data", whole.read("data"))
    assert "cannot be loaded" in refusal(f"sb3:{half}")


def test_choices_among_actions_are_refused_with_the_forms_that_there_are(tmp_path):
    class Choices(gymnasium.ActionWrapper):
        def __init__(self, env):
            super().__init__(env)
            self.action_space = gymnasium.spaces.Discrete(2)

    _, spec = saved(tmp_path / "dqn.zip", DQN, Choices(toy()), buffer_size=10)
    assert "pedal (2,)" in refusal(spec)


def test_an_observation_that_we_do_not_offer_is_refused_by_name(tmp_path):
    space = toy().observation_space

    def with_entry(name, part):
        changed = gymnasium.spaces.Dict({**space.spaces, name: part})
        return TransformObservation(toy(), lambda observation: observation, changed)

    vector = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
    _, spec = ppo(tmp_path / "other.zip", with_entry("spede", vector))
    message = refusal(spec)
    assert "'spede'" in message
    assert "did you mean 'speed'" in message
    _, spec = ppo(tmp_path / "shape.zip", with_entry("routing", vector))
    message = refusal(spec)
    assert "'routing'" in message
    assert "(50, 4) float32, a row from [-100, -100, -3.14, 0] to [100, 100, 3.14, 1]" in message
    assert len(message) < 600


def test_a_model_that_says_something_unknown_of_itself_is_refused(tmp_path):
    _, spec = ppo(tmp_path / "typo.zip", PedalWrapper(toy()), control_dt=0.2)
    assert "did you mean 'control_dt_s'" in refusal(spec)


def test_without_stable_baselines_the_cure_is_named(tmp_path):
    _, spec = ppo(tmp_path / "ppo.zip", PedalWrapper(toy()))
    code = (
        "import sys; sys.modules['stable_baselines3'] = None\n"
        "from agents import load_agent, AgentSpecError\n"
        f"try: load_agent({spec!r})\n"
        "except AgentSpecError as error: print(error)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120
    )
    assert "driveinsight[rl]" in done.stdout


def test_looking_agents_up_loads_no_torch():
    code = "import sys, agents, agents.sb3.agent; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
