"""The studies that docs/findings.md tells of: their files are whole, and say what it says.

One of the shipped weights is read by today's program. One that was driven before runs named the
world by a version is not; what is checked of all is read from their JSON.
"""

from __future__ import annotations

import json
import tarfile
from collections import Counter
from pathlib import Path
from statistics import fmean

import pytest

from agents.versions import agent_version
from di_envs.world_version import WORLD_VERSION
from leaderboard.records.results import ResultsError, read_run
from leaderboard.studies import StudyError
from leaderboard.studies.rows import BASELINE, NULL
from leaderboard.studies.study_file import read_study

DOCS = Path(__file__).resolve().parents[3] / "docs"
ARCHIVES = sorted((DOCS / "studies").glob("*.tar.xz"))
READ_BY = "529946c"  # the commit that drove those of before
_BEFORE = 1  # their format version
# Of a route, what is not of the drive: its run and its edits' names, and the clock on the wall
ASIDE = frozenset({"run", "interventions", "wall_s"})


@pytest.fixture(scope="module", params=ARCHIVES, ids=lambda path: path.name.partition(".")[0])
def folder(request, tmp_path_factory):
    """A study's folder, unpacked."""
    place = tmp_path_factory.mktemp("study")
    with tarfile.open(request.param) as archive:
        archive.extractall(place, filter="data")
    return place / request.param.name.removesuffix(".tar.xz")


def json_of(path):
    return json.loads(path.read_text(encoding="utf-8"))


def routes_of(folder, row):
    return [json_of(path) for path in sorted((folder / "rows" / row / "routes").glob("*.json"))]


def drives_of(study, row):
    return [dict(zip(study["drive_columns"], drive, strict=True)) for drive in row["drives"]]


def test_there_are_an_ablation_and_a_study_of_prompt_editing():
    assert [path.name.split("-")[0] for path in ARCHIVES] == ["ablation", "prompt"]


def test_every_drive_of_the_study_is_one_of_its_runs(folder):
    study = json_of(folder / "study.json")
    for row in study["rows"]:
        routes = routes_of(folder, row["name"])
        assert len(routes) == len(row["drives"]) == row["planned"]
        for drive, route in zip(drives_of(study, row), routes, strict=True):
            assert drive.pop("episode") == route["state_hash"]
            assert drive.pop("events") == Counter(event["kind"] for event in route["events"])
            assert drive == {name: {**route, **route["score"]}[name] for name in drive}


def test_the_null_row_is_the_baseline_to_the_bit(folder):
    rows = zip(routes_of(folder, BASELINE), routes_of(folder, NULL), strict=True)
    for before, null in rows:
        different = {name for name in before.keys() | null.keys() if before[name] != null[name]}
        assert different <= ASIDE


def test_the_page_says_what_the_record_gives(folder):
    page = (DOCS / "findings.md").read_text(encoding="utf-8")
    lines = (folder / "study.md").read_text(encoding="utf-8").splitlines()
    study = json_of(folder / "study.json")
    found = [line for line in lines if line.startswith("The paper's finding ")]
    if study["kind"] != "ablation":
        assert len(found) == 5
        assert all(line in page for line in found)
        return
    told = [line for line in lines if line.startswith(("| ", "- "))]
    assert len(told) > len(study["rows"])
    for line in told:
        assert line in page
    for row in study["rows"]:
        mean = fmean(drive["driving_score"] for drive in drives_of(study, row))
        assert f"| {row['edit'] or row['name']} | {mean:.1f} |" in page


def test_a_study_of_now_is_of_the_shipped_weights_and_of_the_world_of_now(folder):
    if json_of(folder / "study.json")["format_version"] == _BEFORE:
        pytest.skip("a study of before")
    study = read_study(folder)
    assert study.agent_version == agent_version(study.agent)
    assert study.versions["world"] == str(WORLD_VERSION)
    assert all(read_run(folder / "rows" / each.row.name).complete for each in study.rows)


def test_of_a_study_of_before_the_pages_say_which_program_reads_it(folder):
    if json_of(folder / "study.json")["format_version"] != _BEFORE:
        pytest.skip("a study of now")
    with pytest.raises(StudyError, match=r"has format version 1.*the version that wrote it"):
        read_study(folder)
    with pytest.raises(ResultsError, match=r"has format version 2.*the version that wrote it"):
        read_run(folder / "rows" / BASELINE)
    for name in ("findings", "studies", "results"):
        assert READ_BY in (DOCS / f"{name}.md").read_text(encoding="utf-8"), name
