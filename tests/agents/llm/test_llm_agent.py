"""A function as a driver: told the prompt as text, and where it likes as a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from agents import AgentSpecError, load_agent
from agents.base import Track
from agents.llm.answers import AnswerError
from agents.ownership import code_of_others
from agents.versions import agent_version
from di_envs.drawing.told_text import told_text
from di_envs.prompt import COMPONENTS, empty_prompt

SAID = """
def stop(text):
    assert text.count("not given") == 0
    return '{"manoeuvre": "stop"}'

def go(text, picture):
    assert picture.shape == (640, 640, 3)
    return '{"waypoints": [[3.0, 0.0], [6.5, 0.0]]}'

def crawl(text):
    return '{"manoeuvre": "follow", "speed_mps": 0.2}'

def talk(text):
    return "gladly"
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "said.py"
    path.write_text(SAID, encoding="utf-8")
    return path


def observation(speed_mps=6.0):
    """A straight route of 50 m, and nobody."""
    prompt = empty_prompt()._asdict()
    prompt["routing"][:] = [(1.0 + i, 0.0, 0.0, 1.0) for i in range(50)]
    prompt["speed"][:] = speed_mps
    prompt["command"] = prompt["command"][0]
    return {**prompt, "prompt_present": np.ones(len(COMPONENTS), np.int8)}


def act(file, name, seen):
    agent = load_agent(f"llm:{file}:{name}")
    return agent.act(seen, agent.start(None, 0))[0].tolist()


def test_what_is_answered_is_what_is_driven(file):
    throttle, steer, brake = act(file, "stop", observation())
    assert (throttle, steer) == (0.0, 0.0)
    assert brake > 0.2
    throttle, steer, brake = act(file, "go?picture=on", observation(speed_mps=5.0))
    assert throttle > 0.0
    assert (steer, brake) == (0.0, 0.0)
    assert act(file, "crawl", observation())[2] > 0.2


def test_an_answer_in_prose_ends_the_drive_with_what_was_expected(file):
    with pytest.raises(AnswerError, match="gladly"):
        act(file, "talk", observation())


def test_it_is_code_of_others_and_told_by_its_file(file):
    spec = f"llm:{file}:stop"
    assert code_of_others(spec) == f"the file {file}"
    before = agent_version(spec)
    assert before.startswith("llm 1, files ")
    file.write_text(SAID + "# changed", encoding="utf-8")
    assert agent_version(spec) != before
    assert load_agent(spec).requires.track == Track.PROMPT


@pytest.mark.parametrize(
    ("spec", "fault"),
    [
        ("llm:json", "expected llm:MODULE:FUNCTION"),
        ("llm:json:drive", "json has no function 'drive'"),
        ("llm:nowhere:drive", "no module 'nowhere'"),
        ("llm:json:loads?picture=yes", "picture is on or off; got 'yes'"),
        ("llm:json:loads?control_dt_s=0", "control_dt_s must be positive"),
    ],
)
def test_a_wrong_name_says_what_is_wrong(spec, fault):
    with pytest.raises(AgentSpecError, match=fault):
        load_agent(spec)


def test_the_text_says_every_object_with_its_number_and_what_is_not_given():
    seen = observation()
    seen["obstacles"][0] = (12.0, -1.5, 0.0, 4.5, 1.9, 5.0, -0.04, 1, 1.0)
    seen["traffic_lights"][0] = (20.0, 1.0, 0.1, 3, 1.0)
    seen["stop_signs"][0] = (30.0, 0.0, -1.5708, 1.0)
    seen["prompt_present"][COMPONENTS.index("speed")] = 0
    lines = told_text(seen).splitlines()
    first = next(line for line in lines if line.startswith("1. "))
    assert first.startswith("1. car at (12.0, -1.5), 4.5 m long, 1.9 m wide, heading 0 degrees")
    assert first.endswith(", moves (5.0, 0.0) a second")
    assert "L1. red at (20.0, 1.0), heading 6 degrees" in lines
    assert "S1. at (30.0, 0.0), heading -90 degrees" in lines
    assert "speed: not given" in lines
    route = next(line for line in lines if line.startswith("routing"))
    assert route.startswith("routing: a point each 5 m: (5.0, 0.0) (10.0, 0.0)")
    assert route.count("(") == 10
