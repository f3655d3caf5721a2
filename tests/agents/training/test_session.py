"""How a training begins: what is filled in, what it goes on from, who is heard."""

from __future__ import annotations

import dataclasses
import os

import pytest
import torch

from agents.driveinsight.model import Policy
from agents.driveinsight.weights import save_pretrained, weights_digest
from agents.training.config import TrainConfig, TrainingError
from agents.training.distributed import ALONE, Team
from agents.training.loop import CHECKPOINT_FILE
from agents.training.session import (
    TrainingPlan,
    begin,
    chosen_precision,
    free_cores,
    one_talks,
)
from tests.agents.training.small_policies import PROMPT_ONLY, SEEING, on_disk


@pytest.fixture
def plan(drives, tmp_path):
    training = TrainConfig(steps=6, batch=4, warm_up=2, held_out=0.1)
    return TrainingPlan(
        policy=PROMPT_ONLY, training=training, data=(drives,), folder=tmp_path / "run"
    )


def with_training(plan, **fields):
    return dataclasses.replace(plan, training=dataclasses.replace(plan.training, **fields))


def test_what_is_known_only_as_it_begins_is_filled_in(plan):
    session = begin(dataclasses.replace(plan, precision="bfloat16"), ALONE, "cpu")
    config = session.training.config
    assert (config.precision, config.processes, config.held_out) == ("bfloat16", 1, 0.1)
    assert len(config.data) == 32
    assert config.init_from == ""
    assert (session.training.step, session.resumed, session.taken) == (0, False, ())
    assert session.about_data().keys() == {plan.data[0].name}
    assert session.samples.training == config


def test_what_is_learnt_by_heart_is_measured_by_nothing_else(plan):
    assert begin(with_training(plan, overfit=1), ALONE, "cpu").training.config.held_out == 0.0


def test_it_goes_on_from_what_its_folder_holds_whatever_it_was_to_begin_with(plan):
    first = begin(plan, ALONE, "cpu")
    first.training.step = 3
    plan.folder.mkdir()
    first.training.save(plan.folder / CHECKPOINT_FILE)
    again = begin(plan, ALONE, "cpu")
    assert again.resumed
    assert again.training.step == 3
    with pytest.raises(TrainingError, match="batch was 4, is 3"):
        begin(with_training(plan, batch=3), ALONE, "cpu")


def test_it_begins_with_what_fits_of_another_policy(plan, tmp_path):
    torch.manual_seed(3)
    teacher = Policy(dataclasses.replace(SEEING, planner=PROMPT_ONLY.planner))
    save_pretrained(teacher, tmp_path / "teacher", "a card")
    session = begin(dataclasses.replace(plan, init_from=tmp_path / "teacher"), ALONE, "cpu")
    assert session.training.config.init_from == weights_digest(tmp_path / "teacher")
    assert not session.resumed
    ours, theirs = session.training.policy.state_dict(), teacher.state_dict()
    assert set(session.taken) <= set(ours)
    assert all(torch.equal(ours[name], on_disk(theirs[name])) for name in session.taken)
    assert set(session.left) == set(theirs) - set(session.taken)
    assert session.left


def test_a_batch_that_the_team_cannot_share_says_what_to_choose(plan):
    with pytest.raises(TrainingError, match="3 processes cannot share batches of 4 evenly"):
        begin(plan, Team(size=3), "cpu")


def test_what_is_asked_for_is_taken_and_auto_asks_the_hardware(monkeypatch):
    assert chosen_precision("float32", "cuda:1") == "float32"
    for fast, precision in ((True, "bfloat16"), (False, "float32")):
        monkeypatch.setattr(torch.cpu, "get_capabilities", lambda fast=fast: {"amx_bf16": fast})
        assert chosen_precision("auto", "cpu") == precision


def test_processes_share_the_cores_that_are_left_when_each_has_one(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 16)
    assert free_cores(ALONE) == 15
    assert free_cores(Team(size=8, here=4)) == 3  # 16 / 4 - 1
    assert free_cores(Team(size=16, here=16)) == 1


def test_only_the_first_of_a_team_is_heard(capsys):
    for rank in (0, 1):
        with one_talks(Team(rank=rank, size=2)):
            print(f"process {rank}")
    assert capsys.readouterr().out == "process 0\n"
