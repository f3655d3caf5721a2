"""The studies that docs/findings.md tells of: their records are whole, and say what it says."""

from __future__ import annotations

import dataclasses
import tarfile
from pathlib import Path

import pytest

from leaderboard.records.footing import footing_differences, footing_here, footing_of
from leaderboard.records.results import read_run
from leaderboard.replaying.replay import replay_env
from leaderboard.replaying.verify import verify_route
from leaderboard.studies.ablation import work_out
from leaderboard.studies.approaches import GREEN_SHOWN, approaches
from leaderboard.studies.prompt_editing import finding_sentence, judgements_of
from leaderboard.studies.record import StudyDrive
from leaderboard.studies.rows import BASELINE, NULL
from leaderboard.studies.study_file import read_study
from leaderboard.tables.ablation_table import ablation_markdown

DOCS = Path(__file__).resolve().parents[3] / "docs"
ARCHIVES = sorted((DOCS / "studies").glob("*.tar.xz"))


@pytest.fixture(scope="module", params=ARCHIVES, ids=lambda path: path.name.partition(".")[0])
def folder(request, tmp_path_factory):
    """A study's folder, unpacked."""
    place = tmp_path_factory.mktemp("study")
    with tarfile.open(request.param) as archive:
        archive.extractall(place, filter="data")
    return place / request.param.name.removesuffix(".tar.xz")


def test_there_are_an_ablation_and_a_study_of_prompt_editing():
    assert [path.name.split("-")[0] for path in ARCHIVES] == ["ablation", "prompt"]


def test_every_drive_of_the_study_is_one_of_its_runs(folder):
    for driven in read_study(folder).rows:
        run = read_run(folder / "rows" / driven.row.name)
        assert driven.drives == tuple(StudyDrive.of(record) for record in run.scored)
        assert len(run.scored) == run.planned == driven.planned


def test_the_null_row_is_the_baseline_to_the_bit(folder):
    before, null = (read_run(folder / "rows" / name) for name in (BASELINE, NULL))
    for one, other in zip(before.routes, null.routes, strict=True):
        alike = dataclasses.replace(other, interventions=one.interventions)
        assert alike.fingerprint() == one.fingerprint()


def test_the_page_says_what_the_record_gives(folder):
    page, study = (DOCS / "findings.md").read_text(encoding="utf-8"), read_study(folder)
    if judgements := judgements_of(study):
        for judgement in judgements:
            assert finding_sentence(judgement) in " ".join(page.split())
        return
    lines = ablation_markdown(work_out(study), "").splitlines()
    told = [line for line in lines if line.startswith(("| ", "- "))]
    assert len(told) > len(study.rows)
    for line in told:
        assert line in page


def test_drives_of_the_study_stand_up_to_a_replay(folder):
    rows = [driven.row.name for driven in read_study(folder).rows]
    for name in (rows[0], rows[len(rows) // 2], rows[-1]):
        run = read_run(folder / "rows" / name)
        if differences := footing_differences(footing_here(), footing_of(run)):
            pytest.skip(f"bits may differ: {'; '.join(differences)}")
        env = replay_env(run)
        shortest = min(run.scored, key=lambda record: record.steps)
        assert verify_route(run, shortest, env).problems == ()
        env.close()


def test_a_light_that_was_yellow_as_the_ego_shown_green_drove_over_it_is_a_case(folder):
    rows = [driven.row for driven in read_study(folder).rows if driven.row.edit == GREEN_SHOWN]
    for row in rows:  # one of prompt editing, none of the ablation
        run = read_run(folder / "rows" / row.name)
        if differences := footing_differences(footing_here(), footing_of(run)):
            pytest.skip(f"bits may differ: {'; '.join(differences)}")
        env = replay_env(run)
        record = next(each for each in run.scored if each.route_id == "5" and each.seed == 0)
        found = [(each.colour, each.crossed) for each in approaches(run, record, env)]
        assert found == [("green", False), ("red", True)]
        env.close()
