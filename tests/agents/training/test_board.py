"""Boards: TensorBoard holds the rows that a training told, and forgets those that come again."""

from __future__ import annotations

import sys

import pytest

from agents.training.board import board
from agents.training.config import TrainingError


def told(folder, name):
    """(step, value) of all that TensorBoard shows under a name."""
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    found = events.EventAccumulator(str(folder))
    found.Reload()
    return [(each.step, each.value) for each in found.Scalars(name)]


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of TensorBoard's own
def test_tensorboard_shows_the_log_and_what_came_again_only_once(tmp_path):
    pytest.importorskip("tensorboard", reason="needs the extra policy")
    with board(tmp_path) as tell:
        for step in (20, 40, 60):
            tell({"step": step, "waypoints": 1.0 / step, "held_out": None})
    with board(tmp_path, first_step=41) as tell:
        tell({"step": 60, "waypoints": 0.5})
    assert [step for step, _ in told(tmp_path, "waypoints")] == [20, 40, 60]
    assert told(tmp_path, "waypoints")[-1] == (60, 0.5)


def test_of_a_team_only_the_first_tells(tmp_path):
    with board(tmp_path / "none", told=False, project="never asked for") as tell:
        tell({"step": 1, "loss": 1.0})
    assert not (tmp_path / "none").exists()


def test_a_project_without_wandb_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "wandb", None)
    needed = pytest.raises(TrainingError, match=r"pip install 'driveinsight\[wandb\]'")
    with needed, board(tmp_path, project="mine"):
        pass


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of wandb's own
def test_weights_and_biases_goes_on_with_the_run_that_it_began(tmp_path, monkeypatch):
    wandb = pytest.importorskip("wandb", reason="needs the extra wandb")
    monkeypatch.setenv("WANDB_MODE", "offline")
    monkeypatch.setenv("WANDB_SILENT", "true")
    ids = []
    for first in (0, 41, 0):
        with board(tmp_path, first_step=first, project="mine", about={"steps": 60}) as tell:
            tell({"step": first + 19, "waypoints": 1.0})
            ids.append(wandb.run.id)
    assert ids[0] == ids[1] != ids[2]
    assert list(tmp_path.rglob("*.wandb"))
