"""docs/explaining.md says what is so: its Python runs, its commands parse, its table agrees."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
import torch
import tyro

from agents.driveinsight.config import config_named
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import save_pretrained
from agents.explain.situations import SITUATIONS
from leaderboard.commands.cli import Command, main
from leaderboard.records.results import write_run
from tests.leaderboard.short_drives import short_run

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "explaining.md").read_text(encoding="utf-8")
LOOK, RETRACE, SHUFFLE, OWN = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_decision_is_looked_at_and_its_weights_are_shuffled(capsys):
    names = {}
    exec(LOOK, names)  # our own text
    shown = capsys.readouterr().out
    assert "traffic_lights  Gx" in shown
    assert "(-8.0, 30.4, -19.2, 19.2)" in shown
    exec(SHUFFLE, names)
    assert capsys.readouterr().out.startswith("planner {'bev': ")


def test_a_recorded_drive_is_looked_into(capsys):
    torch.manual_seed(0)
    save_pretrained(Policy(config_named("tiny")), Path("policy"), "a card")
    write_run(Path("results/mine"), short_run("driveinsight:policy", 6, traffic=0, walkers=0))
    exec(RETRACE, {})
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["0.0", "0.5"]


def test_the_policy_of_another_make_is_explained_and_its_drives_too(capsys):
    exec(OWN, {})
    assert "'obstacles': [" in capsys.readouterr().out
    write_run(Path("results/mine"), short_run("mine.py:Mine", 6, traffic=0, walkers=0))
    assert main(["respond", "results/mine", "--routes", "all", "--agent", "mine.py:Mine"]) == 0
    shown = capsys.readouterr().out
    assert "routing" in shown
    assert "Next: driveinsight respond results/mine --route ID" in shown


def test_the_commands_parse():
    lines = [
        line
        for block in re.findall(r"^```sh\n(.*?)^```", PAGE, re.M | re.S)
        for line in block.splitlines()
    ]
    assert len(lines) >= 5
    for line in lines:
        program, *words = shlex.split(line, comments=True)
        assert program == "driveinsight"
        tyro.cli(Command, args=words)


def test_the_table_of_situations_is_what_there_is():
    named = re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE)
    assert tuple(named[: len(SITUATIONS)]) == SITUATIONS
