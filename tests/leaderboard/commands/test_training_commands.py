"""`collect`, `train` and `export`, from nothing to a policy that drives, as a user calls them."""

from __future__ import annotations

import csv
import io
import json
import shutil
import tarfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from agents.versions import agent_version
from leaderboard.commands.cli import main
from leaderboard.commands.ending import EXIT_USAGE


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data") / "data"
    arguments = ["--towns", "small_grid", "--frames", "150", "--output", str(folder)]
    assert main(["collect", *arguments]) == 0
    return folder


@pytest.fixture(scope="module")
def policy(data, tmp_path_factory):
    """Trained for three steps: it drives like it."""
    folder = tmp_path_factory.mktemp("run")
    arguments = ["--config", "driveinsight-told", "--data", str(data), "--output", str(folder)]
    arguments += ["--steps", "3", "--batch", "2", "--workers", "0"]
    arguments += ["--cache", str(folder / "cache")]
    assert main(["train", *arguments, "--check-routes", "1", "--check-every", "3"]) == 0
    return folder / "policy"


def test_collecting_tells_what_there_is_and_what_is_next(data, capsys):
    assert main(["collect", "--towns", "small_grid", "--frames", "100", "--output", str(data)]) == 0
    out = capsys.readouterr().out
    card = json.loads((data / "card.json").read_text())
    assert f"{card['drives']} drives with {card['moments']} moments" in out
    assert "lanefollow" in out
    assert f"Next: driveinsight train --config driveinsight --data {data}" in out


def test_training_leaves_a_policy_that_drove_its_log_and_its_card(policy):
    with (policy.parent / "checks.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["step"] == "3"
    assert 0.0 <= float(row["driving_score"]) <= 100.0
    card = (policy / "README.md").read_text()
    assert '"moments"' in card
    assert "| step | driving_score |" in card


def test_training_that_is_done_says_so_again_and_trains_no_more(policy, data, capsys):
    before = (policy / "weights.safetensors").read_bytes()
    arguments = ["--config", "driveinsight-told", "--data", str(data)]
    arguments += ["--output", str(policy.parent), "--steps", "3", "--batch", "2", "--workers", "0"]
    arguments += ["--cache", str(policy.parent / "cache")]
    assert main(["train", *arguments, "--check-routes", "1", "--check-every", "3"]) == 0
    out = capsys.readouterr().out
    assert "Goes on from step 3" in out
    assert f"Next: driveinsight evaluate --agent driveinsight:{policy}" in out
    assert (policy / "weights.safetensors").read_bytes() == before


def test_beginning_with_another_policy_tells_what_was_taken(policy, data, tmp_path, capsys):
    arguments = ["--config", "route-only", "--data", str(data), "--output"]
    arguments += [str(tmp_path), "--steps", "1", "--batch", "1", "--workers", "0"]
    arguments += ["--check-routes", "0", "--init-from", str(policy)]
    arguments += ["--cache", str(tmp_path / "cache")]
    assert main(["train", *arguments]) == 0
    out = capsys.readouterr().out
    assert "Taken from" in out
    assert "prompt (" in out
    assert "planner (" in out


def test_a_planner_alone_is_checked_with_lent_eyes_and_the_next_step_says_so(
    data, tmp_path, capsys
):
    arguments = ["--config", "tiny", "--plan-only", "--data", str(data), "--steps", "2"]
    arguments += ["--batch", "2", "--output", str(tmp_path), "--cache", str(tmp_path / "cache")]
    assert main(["train", *arguments, "--check-routes", "1", "--check-every", "2"]) == 0
    assert (tmp_path / "checks.csv").is_file()
    policy = tmp_path / "policy"
    assert f"driveinsight evaluate --agent true-sight:{policy}" in capsys.readouterr().out


def test_a_policys_version_changes_with_its_weights_and_not_with_its_card(policy, tmp_path):
    copy = Path(shutil.copytree(policy, tmp_path / "copy"))
    before = agent_version(f"driveinsight:{policy}")
    (copy / "README.md").write_text("another card")
    assert agent_version(f"driveinsight:{copy}") == before
    (copy / "weights.safetensors").write_bytes(b"other")
    assert agent_version(f"driveinsight:{copy}") != before


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["train", "--config", "tinny"], "did you mean 'tiny'"),
        (["train", "--data", "nowhere", "--config", "tiny"], "run `driveinsight collect` first"),
        (["train", "--init-from", "nowhere"], "give a folder that `driveinsight train` wrote"),
        (["train", "--steps", "0"], "steps must be at least 1"),
        (["train", "--check-every", "0"], "--check-every must be at least 1"),
        (["collect", "--towns", "suburbs"], "did you mean 'suburb'"),
        (["collect", "--frames", "0"], "must be at least 1"),
        (["export", "--data", "nowhere"], "run `driveinsight collect` first"),
        (["export", "--cameras", "smal"], "did you mean 'small'"),
        (
            ["evaluate", "--agent", "driveinsight:nowhere", "--suite", "toy"],
            "that `driveinsight train` wrote",
        ),
    ],
)
def test_a_wrong_request_says_what_to_do(arguments, told, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == EXIT_USAGE
    assert told in capsys.readouterr().err


@pytest.fixture(scope="module")
def shards(data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("shards")
    arguments = ["--data", str(data), "--output", str(folder), "--cameras", "rl"]
    assert main(["export", *arguments, "--drives-per-shard", "1"]) == 0
    return folder


def test_shards_hold_a_samples_files_one_after_the_other(shards, data):
    path = sorted(shards.iterdir())[0]
    assert path.name == "driveinsight-000000.tar"
    with tarfile.open(path) as tar:
        names = tar.getnames()
        parts = {
            name.partition(".")[2]: tar.extractfile(name).read()  # type: ignore[union-attr]
            for name in names[:5]
        }
    key = names[0].partition(".")[0]
    assert {name.partition(".")[0] for name in names[:5]} == {key}
    assert list(parts) == ["camera_front.png", "lidar.npy", "prompt.npz", "waypoints.npy", "json"]
    assert Image.open(io.BytesIO(parts["camera_front.png"])).size == (84, 84)
    assert np.load(io.BytesIO(parts["lidar.npy"])).shape[1] == 4
    assert np.load(io.BytesIO(parts["waypoints.npy"])).shape == (8, 2)
    with np.load(io.BytesIO(parts["prompt.npz"])) as prompt:
        assert prompt["obstacles"].shape == (32, 9)
    about = json.loads(parts["json"])
    assert about["town"] == "small_grid"
    assert about["waypoints_valid"] == 8


def test_shards_rendered_again_by_two_processes_have_the_same_bytes(shards, data, tmp_path):
    arguments = ["--data", str(data), "--output", str(tmp_path), "--cameras", "rl"]
    assert main(["export", *arguments, "--drives-per-shard", "1", "--workers", "2"]) == 0
    files = {path.name: path.read_bytes() for path in sorted(shards.iterdir())}
    assert {path.name: path.read_bytes() for path in sorted(tmp_path.iterdir())} == files
