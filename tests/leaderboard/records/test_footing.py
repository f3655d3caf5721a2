"""What a run rests on survives an edit: no renamed module, comment or Python makes it another."""

from __future__ import annotations

import dataclasses
import json
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from agents import AGENTS
from agents.versions import agent_packages, agent_version
from di_envs.world_version import WORLD_VERSION
from leaderboard.records import versions
from leaderboard.records.footing import (
    footing_differences,
    footing_here,
    footing_of,
    record_differences,
)
from leaderboard.records.run_json import run_hash
from tests.leaderboard.made_records import run_of

ROOT = Path(__file__).resolve().parents[3]
PACKAGES = ("agents", "di_envs", "leaderboard", "wrappers")
EDITED = (
    "di_envs/world/traffic/car_following.py",
    "di_envs/town/reading/arms.py",
    "di_envs/route_env.py",
    "agents/expert/agent.py",
    "agents/driveinsight/agent.py",
)
RESTS_ON = """
import json, pathlib, sys
from agents import AGENTS
from agents.versions import agent_version
from di_envs.town.cache import content_hash
from leaderboard.records.footing import footing_here
print(json.dumps({
    "from": str(pathlib.Path(sys.modules["agents"].__file__).parents[1]),
    "agents": {name: [agent_version(name), footing_here(name)] for name in AGENTS},
    "town": content_hash(b"map", b"signals"),
}))
"""


def rests_on(tree: Path) -> dict[str, object]:
    """The footings that a tree of ours claims, in a process of its own."""
    found: dict[str, object] = json.loads(
        subprocess.run(
            [sys.executable, "-c", RESTS_ON],
            capture_output=True,
            text=True,
            check=True,
            cwd=tree,
            env={**os.environ, "PYTHONPATH": str(tree)},
        ).stdout
    )
    assert found.pop("from") == str(tree)
    return found


@pytest.fixture(scope="module")
def here():
    return rests_on(ROOT)


@pytest.fixture
def tree(tmp_path):
    """A copy of our packages, to be edited."""
    for name in PACKAGES:
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def test_comments_and_a_renamed_module_leave_the_footing_as_it_was(here, tree):
    for file in EDITED:
        path = tree / file
        path.write_text(path.read_text() + "\n# one more comment\n")
    (tree / "agents" / "constant.py").rename(tree / "agents" / "steady.py")
    table = tree / "agents" / "table.py"
    table.write_text(table.read_text().replace("agents.constant:", "agents.steady:"))
    card = tree / "agents/driveinsight/weights/driveinsight/README.md"
    card.parent.mkdir(parents=True, exist_ok=True)
    card.write_text("another card\n")
    assert rests_on(tree) == here


def test_weights_and_a_declared_version_are_another_footing(here, tree):
    weights = tree / "agents/driveinsight/weights/driveinsight/weights.safetensors"
    weights.parent.mkdir(parents=True, exist_ok=True)
    weights.write_bytes(b"other weights")
    table = tree / "agents" / "table.py"
    now, new = AGENTS["expert"].version, AGENTS["expert"].version + 1  # the first in the table
    table.write_text(table.read_text().replace(f"version={now},", f"version={new},", 1))
    world = tree / "di_envs" / "world_version.py"
    raised = f"WORLD_VERSION = {WORLD_VERSION + 1}"
    world.write_text(world.read_text().replace(f"WORLD_VERSION = {WORLD_VERSION}", raised))
    ours, theirs = here["agents"], rests_on(tree)["agents"]
    changed = {name for name in ours if ours[name][0] != theirs[name][0]}
    assert changed == {"expert", "driveinsight"}
    assert theirs["expert"][0] == f"expert {new}"
    for name in AGENTS:
        assert footing_differences(ours[name][1], theirs[name][1]) == [
            f"world {WORLD_VERSION}, not {WORLD_VERSION + 1}"
        ]


def test_another_python_is_written_down_and_is_the_same_footing(monkeypatch):
    before, was = footing_here("expert"), versions.package_versions("expert")
    monkeypatch.setattr(platform, "python_version", lambda: "3.99.0")
    assert versions.package_versions("expert") == {**was, "python": "3.99.0"} != was
    assert footing_here("expert") == before
    run = run_of(planned=1, versions={**was})
    other = dataclasses.replace(run, versions=versions.package_versions("expert"))
    assert record_differences(run, other, ("versions", "cpu")) == []
    assert footing_of(run) == footing_of(other)
    assert run_hash(run) == run_hash(other)


def test_the_world_has_a_version_in_every_footing():
    assert footing_here()["world"] == str(WORLD_VERSION)
    assert {"numpy", "numba", "llvmlite", "gymnasium", "CPU"} <= footing_here().keys()


def test_torch_counts_below_those_drivers_only_that_load_it():
    assert "torch" not in footing_here("expert")
    assert "torch" in footing_here("driveinsight")
    assert {"torch", "stable-baselines3"} <= footing_here("sb3:model.zip").keys()
    assert "stable-baselines3" not in footing_here("driveinsight:some/folder")
    assert agent_packages("highway") == ("highway-env",)
    # who knows what other people's code loads
    for spec in ("mine.py:Mine", "mine:Mine", "carla:mine.py"):
        assert {"torch", "highway-env", "stable-baselines3"} <= footing_here(spec).keys()
        # until one was made, which has loaded them or not
        assert "torch" not in versions.package_versions(spec, loaded=())
        assert agent_packages(spec, loaded=("torch", "highway-env")) == ("highway-env", "torch")
    assert agent_packages("driveinsight", loaded=()) == ("torch",)  # ours say so themselves


def test_a_package_that_an_agents_file_names_counts_before_it_is_loaded(tmp_path):
    mine = tmp_path / "mine.py"
    for text, packages in (("x = 1", ()), ("def start():\n    import torch", ("torch",))):
        mine.write_text(text)
        for spec in (f"{mine}:Mine", f"carla:{mine}", f"pickled:{mine}"):
            assert agent_packages(spec, loaded=()) == packages


def test_what_only_one_driver_rests_on_is_no_difference_between_their_worlds():
    expert = footing_here("expert")
    learnt = {**footing_here("driveinsight"), "torch": "2.13.0"}
    assert footing_differences(expert, learnt) == []
    assert footing_differences(learnt, {**learnt, "torch": "2.12.0"}) == [
        "torch 2.13.0, not 2.12.0"
    ]
    assert footing_differences(expert, {**expert, "CPU": "z80"}) == [
        f"CPU {expert['CPU']}, not z80"
    ]
    without = {name: version for name, version in expert.items() if name != "numpy"}
    assert footing_differences(without, expert) == [f"numpy absent, not {expert['numpy']}"]


def test_files_of_the_users_own_are_told_by_what_they_hold(tmp_path):
    agent, config = tmp_path / "mine.py", tmp_path / "mine.yaml"
    specs = (f"{agent}:Mine", f"carla:{agent}", f"carla:{agent}?config={config}", f"sb3:{agent}")
    config.write_text("a")
    agent.write_text("one")
    before = [agent_version(spec) for spec in specs]
    assert [text.rpartition(" ")[0] for text in before] == [
        "file", "carla 3, files", "carla 3, files", "sb3 1, files"
    ]  # fmt: skip
    config.write_text("b")
    after = [agent_version(spec) for spec in specs]
    assert [one == other for one, other in zip(before, after, strict=True)] == [
        True, True, False, True
    ]  # fmt: skip
    agent.write_text("two")
    assert not set(before) & {agent_version(spec) for spec in specs}


def test_a_module_of_the_users_own_is_told_by_its_file():
    assert agent_version("agents.constant:ConstantAgent") == agent_version(
        f"{ROOT / 'agents' / 'constant.py'}:ConstantAgent"
    )
    assert agent_version("constant") == "constant 1"
