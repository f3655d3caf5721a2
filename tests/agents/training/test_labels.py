"""Labels hold no secrets: whoever shows a learner the way decides from what the car could see."""

from __future__ import annotations

import numpy as np
import pytest

from agents.expert.agent import Expert
from agents.expert.occlusion import buildings_of
from agents.training import collect, corrections
from agents.training.collect import DriveJob, drive_job
from tests.agents.expert.scrambling import scrambled

TIMID = "tests.agents.training.learners:Timid"


class Doubted(Expert):
    """The expert, asked each time what it would do if all were otherwise that it cannot see."""

    asked = 0
    otherwise = 0

    def __init__(self) -> None:
        super().__init__()
        self._random = np.random.default_rng(3)

    def act(self, observation, memory):
        view = observation["world"]
        other = scrambled(view, buildings_of(view.town), self._random)
        got, left = super().act({"world": other}, memory)
        control, memory = super().act(observation, memory)
        assert got.tolist() == control.tolist()
        assert left.progress == memory.progress
        Doubted.asked += 1
        Doubted.otherwise += int((other.state.kind != view.state.kind).sum())
        return control, memory


@pytest.fixture
def doubted(monkeypatch):
    """In the place of the expert, wherever drives are made."""
    loaded, driver = collect.load_agent, collect._driver
    monkeypatch.setattr(Doubted, "asked", 0)
    monkeypatch.setattr(Doubted, "otherwise", 0)
    monkeypatch.setattr(corrections, "load_agent", lambda name: {"expert": Doubted()}[name])
    monkeypatch.setattr(
        collect, "_driver", lambda name: Doubted() if name == "expert" else driver(name)
    )
    assert type(loaded("expert")) is Expert  # which this stands for, untold
    assert not loaded("expert")._told
    return Doubted


def test_the_expert_that_drives_decides_the_same_whatever_it_does_not_see(doubted, tmp_path):
    assert drive_job(DriveJob(folder=tmp_path, town="small_grid", number=0)).fresh
    assert doubted.asked > 200
    assert doubted.otherwise > 0


def test_the_expert_that_corrects_decides_the_same_in_every_branch(doubted, tmp_path):
    job = DriveJob(folder=tmp_path, town="small_grid", number=0, driver=TIMID)
    moments = drive_job(job).moments
    assert doubted.asked > 20 * moments > 200  # beside the learner, and in branches of 4 s
    assert doubted.otherwise > 0
