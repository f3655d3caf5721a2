"""A results folder from a stranger: no code that it names or brings runs.

The commands are given it as a user gives it to them.
"""

from __future__ import annotations

import base64
import json
import pickle
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from agents import AgentSpecError, load_agent
from leaderboard.commands.cli import main
from leaderboard.records.results import write_run
from tests.hostile.formats import Ran
from tests.leaderboard.made_records import route, run_of

CODE = 'import pathlib\npathlib.Path("PWN").touch()\n\n\nclass Mine:\n    pass\n'
NAMED = ["theirs.py:Mine", "theirs:Mine", "carla:theirs.py", "sb3:theirs.zip"]
LOOKS = {
    "branch": ["branch", "run", "--route", "1", "--at", "0"],
    "explain": ["explain", "run", "--route", "1"],
    "respond": ["respond", "run", "--route", "1"],
}


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a stranger's code in it."""
    inside = tmp_path / "in"
    inside.mkdir()
    monkeypatch.chdir(inside)
    monkeypatch.syspath_prepend(inside)
    Path("theirs.py").write_text(CODE)
    a_model_with_code(Path("theirs.zip"), inside / "PWN")
    return inside


def a_model_with_code(path: Path, canary: Path) -> None:
    """A model as Stable-Baselines3 saves it; whoever loads it runs code."""
    code = base64.b64encode(pickle.dumps(Ran(canary))).decode()
    data = {"policy_class": {"__module__": "x", ":serialized:": code}, "gae_lambda": 1.0}
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data", json.dumps(data))


def received(**fields: object) -> None:
    """A run in the folder `run`, of which a field says something else."""
    record = replace(route("1"), steps=5, interventions=fields.get("interventions", ()))
    write_run(Path("run"), run_of(record, **fields))


@pytest.mark.parametrize("agent", NAMED)
@pytest.mark.parametrize("command", LOOKS)
def test_an_agent_that_a_folder_names_waits_for_trust(command, agent, here, capsys):
    received(agent=agent)
    assert main(LOOKS[command]) == 2
    assert "--trust" in capsys.readouterr().err
    assert not Path("PWN").exists()


@pytest.mark.parametrize("command", [*LOOKS.values(), ["verify", "run", "--observations"]])
def test_edits_that_a_folder_names_wait_for_trust(command, here, capsys):
    received(interventions=("theirs.Mine:speed",))
    assert main(command) == 2
    assert "Mine of the module theirs" in capsys.readouterr().err
    assert not Path("PWN").exists()


@pytest.mark.parametrize("command", ["show", "verify", "report"])
def test_what_only_reads_a_folder_runs_nothing_of_it(command, here):
    received(agent="theirs.py:Mine", interventions=("theirs.Mine:speed",))
    main([command, "run"])
    assert not Path("PWN").exists()


@pytest.mark.parametrize("command", ["drive", "evaluate"])
def test_a_model_with_pickles_waits_for_trust(command, here, capsys):
    words = [command, "--suite", "toy", "--agent", "sb3:theirs.zip"]
    assert main(words) == 2
    said = capsys.readouterr().err
    assert "holds pickles" in said
    assert str(here / "theirs.zip") in said
    assert not Path("PWN").exists()


def test_such_a_model_would_have_run_its_code(here):
    pytest.importorskip("stable_baselines3")
    with pytest.raises(AgentSpecError):
        load_agent("sb3:theirs.zip")
    assert Path("PWN").exists()
