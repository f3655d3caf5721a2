"""Agents are found by name or by place, and every mistake names its cure."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import agents
from agents import AGENTS, AgentSpecError, load_agent
from agents.base import Requirements, Track, make_control
from agents.constant import ConstantAgent
from agents.random import RandomAgent
from di_envs.town.plan import RoutePlan

TOP = Path(__file__).resolve().parents[2]


@pytest.fixture
def plan() -> RoutePlan:
    """Two points, ten metres apart."""
    return RoutePlan(
        route_id="0",
        town="none",
        keypoints=np.array([[0.0, 0, 0], [10, 0, 0]]),
        points=np.array([[0.0, 0, 0, 0], [10, 0, 0, 0]]),
        option=np.array([4, 4], dtype=np.int8),
        lane=np.zeros(2, dtype=np.int32),
        lane_m=np.array([0.0, 10]),
        route_m=np.array([0.0, 10]),
        targets=np.array([1], dtype=np.int32),
    )


def test_every_name_of_the_table_makes_an_agent():
    for name, entry in AGENTS.items():
        if entry.data and not (Path(agents.__file__).parent / entry.data).is_dir():
            with pytest.raises(AgentSpecError, match=r"without its weights|not trained yet"):
                load_agent(name)
            continue
        agent = load_agent(name)
        assert isinstance(agent.requires, Requirements)
        agent.close()


def test_an_agent_is_loaded_from_a_module():
    assert isinstance(load_agent("agents.constant:ConstantAgent", throttle=1.0), ConstantAgent)


def test_an_agent_is_loaded_from_a_file(tmp_path: Path):
    path = tmp_path / "mine.py"
    path.write_text(
        "from agents.constant import ConstantAgent\nclass Mine(ConstantAgent):\n    pass\n"
    )
    agent = load_agent(f"{path}:Mine")
    assert type(agent).__name__ == "Mine"
    assert type(load_agent(f"{path}:Mine")) is type(agent)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("expret", "did you mean 'expert'"),
        ("nobody-at-all", "known: expert, "),
        ("no_such_module:Class", "no module 'no_such_module'"),
        ("agents.constant:ConstantAgnet", "did you mean 'ConstantAgent'"),
        ("nowhere/agent.py:Mine", "there is no file"),
        ("agents.random:RandomMemory", "RandomMemory"),
    ],
)
def test_a_wrong_spec_says_what_is_wrong(spec: str, message: str):
    with pytest.raises((AgentSpecError, TypeError), match=message):
        load_agent(spec)


def test_a_class_that_is_no_agent_is_refused_with_what_it_lacks(tmp_path: Path):
    path = tmp_path / "lazy.py"
    path.write_text("class Lazy:\n    def act(self):\n        pass\n")
    with pytest.raises(AgentSpecError, match="lacks requires, start, close"):
        load_agent(f"{path}:Lazy")


def test_an_import_error_inside_an_agents_file_is_not_hidden(tmp_path: Path):
    path = tmp_path / "broken.py"
    path.write_text("import a_package_that_is_missing\n")
    with pytest.raises(ModuleNotFoundError, match="a_package_that_is_missing"):
        load_agent(f"{path}:Mine")


def test_importing_the_table_imports_no_driver():
    code = "import agents, sys; assert not {'numba', 'highway_env', 'torch'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("requires", "track"),
    [
        (Requirements(), Track.PROMPT),
        (Requirements(observations=("camera", "prompt")), Track.SENSORS),
        (Requirements(observations=("inertial",)), Track.SENSORS),
        (Requirements(observations=("camera",), hd_map=True), Track.MAP),
        (Requirements(observations=("camera",), privileged=True), Track.PRIVILEGED),
    ],
)
def test_the_track_follows_from_what_an_agent_needs(requires: Requirements, track: Track):
    assert requires.track is track


def test_controls_are_clipped_and_nan_is_refused():
    assert make_control(2.0, -3.0, -1.0).tolist() == [1.0, -1.0, 0.0]
    with pytest.raises(ValueError, match="NaN"):
        make_control(float("nan"), 0.0, 0.0)


def test_the_constant_agent_never_changes(plan: RoutePlan):
    agent = ConstantAgent(throttle=0.5)
    memory = agent.start(plan, 0)
    first, memory = agent.act({}, memory)
    first[:] = 9.0
    second, _ = agent.act({}, memory)
    assert second.tolist() == [0.5, 0.0, 0.0]
    with pytest.raises(ValueError, match="throttle"):
        ConstantAgent(throttle=1.5)


def test_the_random_agent_is_a_function_of_seed_and_decision(plan: RoutePlan):
    def drive(agent: RandomAgent, seed: int) -> list[list[float]]:
        memory, controls = agent.start(plan, seed), []
        for _ in range(30):
            control, memory = agent.act({}, memory)
            controls.append(control.tolist())
        return controls

    first = drive(RandomAgent(), 7)
    assert first == drive(RandomAgent(), 7)
    assert first != drive(RandomAgent(), 8)
    assert first[0] == first[9] != first[10]
    assert all(throttle == 0.0 or brake == 0.0 for throttle, _, brake in first)


@pytest.mark.parametrize("name", ["driveinsight", "ego-only"])
def test_who_lacks_torch_is_told_which_extra_brings_it(name):
    code = (
        "import sys; sys.modules['torch'] = None\n"
        "from agents import AgentSpecError, load_agent\n"
        f"try: load_agent({name!r})\n"
        "except AgentSpecError as error: print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=TOP
    )
    assert done.stdout.strip() == (
        f"agent '{name}' needs torch, which is not installed: pip install 'driveinsight[policy]'."
    )
