"""Whose code an agent is, told without running any of it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from agents import AGENTS
from agents.ownership import code_of_others
from agents.versions import agent_version


@pytest.mark.parametrize("spec", [*AGENTS, "driveinsight:runs/mine", "agents.random:RandomAgent"])
def test_agents_of_the_table_and_policies_run_no_code_of_others(spec):
    assert code_of_others(spec) == ""


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ("mine.py:Mine", "the file /"),
        ("carla:team/agent.py?config=a.yaml", "team/agent.py"),
        ("carla:agent.py?no such option", "agent.py"),
        ("carla:agent.py?path=repo,repo/leaderboard&limits=none", "/repo/leaderboard"),
        ("sb3:ppo.zip?control_dt_s=0.2", "the pickles in "),
        ("my.package:Mine", "the module my.package"),
        ("agents.expert.agent:Path", "the module agents.expert.agent (/"),
        (".:Mine", "the module ."),
    ],
)
def test_all_others_are_named_with_their_path(spec, said):
    assert said in code_of_others(spec)


def test_to_name_a_module_or_to_tell_its_version_imports_nothing(tmp_path, monkeypatch):
    package = tmp_path / "loud"
    package.mkdir()
    (package / "__init__.py").write_text("raise SystemExit('imported')\n")
    (package / "inner.py").write_text("class Mine:\n    pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert str(package / "__init__.py") in code_of_others("loud.inner:Mine")
    assert agent_version("loud.inner:Mine").startswith("file ")
    assert agent_version("loud.inner:Mine") == agent_version(f"{package / 'inner.py'}:Mine")
    assert "loud" not in sys.modules
    with pytest.raises(FileNotFoundError, match=r"loud\.outer"):
        agent_version("loud.outer:Mine")


def test_paths_are_whole():
    assert str(Path.cwd() / "mine.py") in code_of_others("mine.py:Mine")
