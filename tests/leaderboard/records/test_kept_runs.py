"""The runs that are kept for others to compare with: of the shipped weights, and as a page says."""

from __future__ import annotations

import tarfile
from pathlib import Path

import pytest

from agents.versions import agent_version
from di_envs.world_version import WORLD_VERSION
from leaderboard.records.results import read_run
from leaderboard.tables.run_tables import driving_interval

DOCS = Path(__file__).resolve().parents[3] / "docs"
ARCHIVES = sorted((DOCS / "runs").glob("*.tar.xz"))


@pytest.fixture(params=ARCHIVES, ids=lambda path: path.name.partition(".")[0])
def run(request, tmp_path):
    with tarfile.open(request.param) as archive:
        archive.extractall(tmp_path, filter="data")
    return read_run(tmp_path / request.param.name.removesuffix(".tar.xz"))


def test_there_is_one():
    assert ARCHIVES


def test_a_kept_run_is_whole_of_the_shipped_weights_and_of_the_world_of_now(run):
    assert run.complete
    assert run.agent_version == agent_version(run.agent)
    assert run.versions["world"] == str(WORLD_VERSION)


def test_the_page_says_what_a_kept_run_gives(run):
    page = (DOCS / "policy.md").read_text(encoding="utf-8")
    lines = [line for line in page.splitlines() if line.startswith(f"| `{run.agent}`, ")]
    (line,) = (line for line in lines if f"| `{run.suite}` |" in line)
    assert f"| {driving_interval(run)} |" in line
