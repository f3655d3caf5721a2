"""Drives collected on a Ray cluster: the same files as with processes of this machine."""

from __future__ import annotations

import importlib.util
import sys

import pytest

from agents import AGENTS
from agents.training.collect import collect
from di_envs.world_version import WORLD_VERSION
from leaderboard.commands.cli import main
from leaderboard.commands.ending import EXIT_USAGE
from leaderboard.running.jobs import SetupError
from leaderboard.running.workers.ray_collect import check_footing, footing_of_driver, ray_pool

TOWN, MOMENTS = "small_grid", 150


@pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="Ray is not installed: driveinsight[ray]"
)
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # Ray's own are not ours
def test_a_cluster_gives_the_same_files_gone_on_with_too(tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    ours = list(collect(here, [TOWN], MOMENTS))
    (there / TOWN).mkdir(parents=True)
    first = ours[0].job.path if not ours[0].why else ours[0].job.dropped_path
    (there / TOWN / first.name).write_bytes(first.read_bytes())
    theirs = list(collect(there, [TOWN], MOMENTS, workers=2, pool=ray_pool(2, None)))
    assert [outcome.fresh for outcome in theirs] == [False, *(True for _ in theirs[1:])]
    assert [outcome.moments for outcome in theirs] == [outcome.moments for outcome in ours]
    assert contents(there) == contents(here)


def contents(folder):
    return {path.name: path.read_bytes() for path in (folder / TOWN).iterdir()}


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"CPU": "z80"}, "CPU z80, not "),
        ({"numpy": "1.0"}, r"numpy 1\.0, not "),
        ({"world": "0"}, f"world 0, not {WORLD_VERSION}"),
        ({"the driver": "expert 0"}, f"the driver expert 0, not expert {AGENTS['expert'].version}"),
    ],
)
def test_a_machine_that_would_give_other_bits_is_refused(other, message):
    here = footing_of_driver("expert")
    check_footing(here, here)
    with pytest.raises(SetupError, match=message):
        check_footing({**here, **other}, here)


def test_a_machine_whose_weights_are_others_is_refused(tmp_path):
    footings = []
    for weights in (b"these", b"those"):
        (tmp_path / "weights.safetensors").write_bytes(weights)
        footings.append(footing_of_driver(f"driveinsight:{tmp_path}"))
    with pytest.raises(SetupError, match=r"driveinsight 2, files .*, not driveinsight 2"):
        check_footing(*footings)


def refused(arguments, tmp_path, capsys):
    arguments = ["--towns", TOWN, "--output", str(tmp_path / "data"), *arguments]
    assert main(["collect", *arguments]) == EXIT_USAGE
    return capsys.readouterr().err


def test_without_ray_the_error_says_what_to_install(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(sys.modules, "ray", None)
    told = refused(["--engine", "ray"], tmp_path, capsys)
    assert "pip install 'driveinsight[ray]'" in told


def test_an_address_needs_the_engine_that_it_is_of(capsys, tmp_path):
    assert "--engine ray" in refused(["--address", "auto"], tmp_path, capsys)
