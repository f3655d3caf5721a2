"""What was recorded of golden drives still comes out; where not, a version must be raised."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from agents import AGENTS
from di_envs.suites import DATA
from tests.golden import drives
from tests.golden.drives import GOLDEN, Driven, drive, label, moved, outdated, recorded_controls
from tests.golden.record import read, recorded

ROOT = Path(__file__).resolve().parents[2]
RECORDED = read()
SUITES = {path.stem for path in (DATA / "suites").glob("*.json")}
QUICK = "expert on toy"


@cache
def driven(name: str) -> Driven:
    """The drive along its recorded controls."""
    return drive(GOLDEN[name], recorded_controls(RECORDED[name]))


def test_every_agent_and_every_suite_has_a_golden_drive():
    can_drive = {name for name, entry in AGENTS.items() if (ROOT / "agents" / entry.data).is_dir()}
    assert {golden.agent for golden in GOLDEN.values()} == can_drive  # some lack their weights yet
    assert {golden.suite for golden in GOLDEN.values()} == SUITES
    assert GOLDEN.keys() == RECORDED.keys()


@pytest.mark.parametrize("name", GOLDEN)
def test_a_golden_drive_is_recorded_under_the_versions_of_today(name):
    assert not outdated(GOLDEN[name], RECORDED[name])


@pytest.mark.parametrize("name", GOLDEN)
def test_a_golden_drive_goes_where_it_went_on_any_machine(name):
    problem = moved(name, RECORDED[name], driven(name), bits=False)
    assert not problem, problem


@pytest.mark.parametrize("name", GOLDEN)
def test_a_golden_drive_has_the_same_bits_where_these_were_recorded(name):
    if label(GOLDEN[name]) not in RECORDED[name]["exact"]:
        pytest.skip(f"no bits are recorded for {label(GOLDEN[name])}: {drives.RECORD_COMMAND}")
    problem = moved(name, RECORDED[name], driven(name), bits=True)
    assert not problem, problem


def test_golden_drives_show_what_their_agents_are_there_for():
    events = {name: {kind for kind, _ in entry["events"]} for name, entry in RECORDED.items()}
    assert "collision_vehicle" in events["expert-blind on toy"]
    assert "red_light" in events["expert-redrunner on toy"]
    assert "stop_sign" in events["expert-signrunner on town05_short"]
    assert not {"collision_vehicle", "red_light", "stop_sign"} & events[QUICK]


# That they can fail, and what they say then


def test_an_agent_that_acts_otherwise_is_told_from_a_world_that_moved(monkeypatch):
    from agents.constant import ConstantAgent

    act = ConstantAgent.act
    monkeypatch.setattr(
        ConstantAgent,
        "act",
        lambda *given: (act(*given)[0] + np.float32(0.01), act(*given)[1]),
    )
    name = "constant on toy"
    there = drive(GOLDEN[name], recorded_controls(RECORDED[name]))
    said = moved(name, RECORDED[name], there, bits=False)
    assert "the agent moved (at decision 0 it did" in said
    assert "raise the version of 'constant' in AGENTS of agents/table.py" in said
    assert drives.RECORD_COMMAND in said
    with pytest.raises(ValueError, match="the agent moved"):
        recorded(name, RECORDED[name])


def test_one_bit_of_an_observation_is_enough():
    here = label(GOLDEN[QUICK])
    entry = {**RECORDED[QUICK], "exact": {here: {**driven(QUICK).hashes, "observations": "00"}}}
    said = moved(QUICK, entry, driven(QUICK), bits=True)
    assert "the world moved (other bits of observations)" in said
    assert "raise WORLD_VERSION in di_envs/world_version.py" in said


def test_a_raised_version_asks_for_a_new_record(monkeypatch):
    monkeypatch.setattr(drives, "WORLD_VERSION", drives.WORLD_VERSION + 1)
    said = outdated(GOLDEN[QUICK], RECORDED[QUICK])
    assert said.startswith("world_version was ")
    assert said.endswith(drives.RECORD_COMMAND)


JUDGED = """
import warnings
warnings.simplefilter("ignore")  # keyed draws overflow, as they should
import di_envs.world.traffic.car_following as idm
idm.TIME_WANTED_S *= {factor}
from tests.golden.drives import GOLDEN, drive, moved, recorded_controls
from tests.golden.record import read
name = {name!r}
entry = read()[name]
print(moved(name, entry, drive(GOLDEN[name], recorded_controls(entry)), bits=False))
"""


@pytest.mark.parametrize("factor", [1.0, 1.1])
def test_another_constant_of_the_idm_is_a_new_version_of_the_world(factor):
    """Uncompiled, as compiled code keeps the constant that it was made with."""
    said = subprocess.run(
        [sys.executable, "-c", JUDGED.format(factor=factor, name=QUICK)],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    ).stdout.strip()
    if factor == 1.0:
        assert said == ""
    else:
        assert said.startswith(f"{QUICK}: the world moved (")
        assert "raise WORLD_VERSION in di_envs/world_version.py" in said
