"""Processes that train together do what one does with the whole batch, and go on exactly."""

from __future__ import annotations

import csv
import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from agents.training.config import TrainConfig
from agents.training.distributed import ALONE, Team, joined_team
from agents.training.learning import Training
from agents.training.loading import Samples, batches, order
from agents.training.loop import CHECKPOINT_FILE, train
from agents.training.moments import load_moments
from tests.agents.training.small_policies import PROMPT_ONLY

TWO = TrainConfig(steps=6, batch=4, warm_up=2, processes=2, held_out=0.5)


def trained(folder, samples, team=ALONE, stop_at=None):
    """Goes on from what the folder holds; returns the loss of each step and the weights."""
    training = Training.begin(PROMPT_ONLY, samples.training, "cpu", team)
    if (folder / CHECKPOINT_FILE).exists():
        training.load(folder / CHECKPOINT_FILE)
    data, losses = batches(samples, first_step=training.step, team=team), []
    train(
        training,
        data,
        folder,
        stop=lambda: training.step == stop_at,
        on_step=lambda step, terms: losses.append(terms["total"]),
    )
    data.close()
    return losses, training.policy.state_dict()


def samples_of(drives, config):
    return Samples(PROMPT_ONLY, config, load_moments([drives], standing_share=0.3))


def member(rank, folder, drives):
    """One of two processes: trains in one go, and again in two halves."""
    torch.set_num_threads(1)
    os.environ |= {"RANK": str(rank), "WORLD_SIZE": "2", "MASTER_ADDR": "127.0.0.1"}
    os.environ |= {"MASTER_PORT": (folder / "port").read_text(), "LOCAL_WORLD_SIZE": "2"}
    with joined_team("cpu") as (team, device):
        assert (team, device) == (Team(rank=rank, size=2, here=2), "cpu")
        samples = samples_of(drives, TWO)
        losses, whole = trained(folder / "whole", samples, team)
        trained(folder / "halves", samples, team, stop_at=3)
        _, halves = trained(folder / "halves", samples, team)
        assert all(torch.equal(value, halves[name]) for name, value in whole.items())
        torch.save((losses, whole), folder / f"{rank}.pt")


def rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def free_port():
    import socket

    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


@pytest.mark.slow
def test_two_processes_learn_as_one_and_go_on_to_the_same_bits(tmp_path, drives):
    (tmp_path / "port").write_text(str(free_port()))
    torch.multiprocessing.spawn(member, (tmp_path, drives), nprocs=2)
    losses, _ = trained(
        tmp_path / "alone", samples_of(drives, dataclasses.replace(TWO, processes=1))
    )
    (seen, first), (_, second) = (
        torch.load(tmp_path / f"{rank}.pt", weights_only=True) for rank in (0, 1)
    )
    assert seen == pytest.approx(losses, rel=1e-4)
    assert all(torch.equal(value, second[name]) for name, value in first.items())
    (ours,), (theirs,), (again,) = (
        rows(tmp_path / name / "log.csv") for name in ("alone", "whole", "halves")
    )
    assert again["held_out"] == theirs["held_out"]
    assert ours.keys() == theirs.keys() == {"step", "waypoints", "total", "held_out"}
    for name, text in ours.items():
        assert float(text) == pytest.approx(float(theirs[name]), rel=1e-4), name


@pytest.mark.full
def test_torchrun_trains_and_one_process_writes(tmp_path, drives):
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2"]
    torchrun += ["--master-port", str(free_port())]
    command = ["train", "--config", "driveinsight-told", "--data", str(drives), "--steps", "2"]
    command += ["--batch", "4", "--workers", "0", "--check-routes", "0"]
    command += ["--output", str(tmp_path / "run")]
    done = subprocess.run(
        [*torchrun, "-m", "leaderboard", *command],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "OMP_NUM_THREADS": "1"},
        cwd=Path(__file__).parents[3],
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("Trained 2 steps") == 1
    assert [row["step"] for row in rows(tmp_path / "run" / "log.csv")] == ["2"]
    assert (tmp_path / "run" / "policy" / "weights.safetensors").exists()


def test_shares_make_up_the_batch_in_order_and_measuring_comes_after_its_step():
    config = TrainConfig(steps=201, batch=32, held_out=0.1)
    whole = list(order(config, 199, slice(0, 32)))
    assert whole == [
        *range(199 * 32, 200 * 32),
        *range(201 * 32, 201 * 32 + 64),  # after step 200
        *range(200 * 32, 201 * 32),
        *range(201 * 32, 201 * 32 + 64),  # after the last one
    ]
    parts = [list(order(config, 199, Team(rank=rank, size=2).share(32))) for rank in (0, 1)]
    assert parts[0][:16] + parts[1][:16] == whole[:32]
    assert sorted(parts[0] + parts[1]) == sorted(whole)


def test_shares_are_weighted_by_what_they_count(monkeypatch):
    """Means of 2 over three waypoints and of 6 over one: over all four (2+2+2+6)/4 = 3."""
    monkeypatch.setattr(Team, "_sum", lambda team, values: torch.tensor([4.0]))
    total = 0.0
    for mean, count in ((2.0, 3.0), (6.0, 1.0)):
        terms = {"waypoints": torch.tensor(mean), "total": torch.tensor(mean)}
        part = Team(size=2).weighted(terms, {"waypoints": torch.tensor(count)})
        assert part["waypoints"] == part["total"]
        total += float(part["total"])
    assert total == 3.0


def test_a_batch_that_cannot_be_shared_evenly_is_refused():
    with pytest.raises(ValueError, match="3 processes cannot share batches of 16 evenly"):
        TrainConfig(processes=3)
