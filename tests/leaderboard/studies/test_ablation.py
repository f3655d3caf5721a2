"""What is worked out of a study, drawn and written, on studies made by hand."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from PIL import Image
from rich.console import Console

from leaderboard.pages.study_files import keep_study, write_ablation
from leaderboard.records.claim_text import NOT_ISOLATED
from leaderboard.studies import StudyError
from leaderboard.studies.ablation import work_out
from leaderboard.studies.ablation_findings import findings, sentences
from leaderboard.studies.effects import EQUIVALENT, MATTERS
from leaderboard.studies.rows import ABLATION_ROWS, choose_rows
from leaderboard.studies.study_file import STUDY_FILE, read_study, write_study
from leaderboard.studies.table_two import TABLE_2
from leaderboard.tables.ablation_table import ablation_markdown, ablation_tables
from tests.leaderboard.studies.drives_here import drive, row, study

ROUTES = [str(number) for number in range(12)]
BASELINE = row("baseline", *(drive(route) for route in ROUTES))
NULL = row("null", *(drive(route) for route in ROUTES))


def fallen(name, by, **fields):
    """A row whose driving score is lower on every route, by a little more or less."""
    drives = (drive(route, ds=90.0 - by - int(route) % 2, **fields) for route in ROUTES)
    return row(name, *drives)


@pytest.fixture
def made():
    red = {"events": {"red_light": 2}, "done_m": 500.0}
    return study(
        BASELINE,
        NULL,
        fallen("drop-map", 40.0),
        fallen("drop-routing", 0.0),
        fallen("drop-traffic_lights", 60.0, **red),
        row("drop-bev", left_out="the policy does not read bev"),
    )


def test_differences_are_means_over_pairs_with_a_verdict_each(made):
    rows = {finding.driven.row.name: finding for finding in work_out(made).rows}
    assert list(rows) == ["drop-map", "drop-routing", "drop-traffic_lights"]
    assert rows["drop-map"].difference.mean == -40.5
    assert rows["drop-map"].verdict == MATTERS
    assert rows["drop-routing"].difference.mean == -0.5
    assert rows["drop-routing"].verdict == EQUIVALENT
    assert rows["drop-routing"].same == 6  # every other drive is as it was
    assert rows["drop-map"].same == 0
    assert rows["drop-traffic_lights"].per_km == {"red_light": 4.0}  # 2 in 500 m, none before
    assert rows["drop-map"].penalty_difference == pytest.approx(-0.405)


def test_intervals_are_corrected_for_the_rows_there_are_not_those_left_out(made):
    assert work_out(made).tests == 3


def test_pairs_are_worlds_that_both_drove():
    half = row("drop-map", *(drive(route, ds=50.0) for route in ROUTES[:6]))
    (finding,) = work_out(study(BASELINE, NULL, half)).rows
    assert finding.difference.pairs == 6


def test_a_sentence_is_said_where_the_paper_differs_and_only_there(made):
    said = sentences(work_out(made))
    assert len(said) == 3
    assert said[0].startswith("drop:map matters here, but hardly in the paper (-40.5 DS")
    assert said[0].endswith("; -0.8 there).")
    assert said[1].startswith("drop:routing makes no difference here, but does in the paper (-0.5")
    assert said[2].startswith("drop:traffic_lights costs more here than in the paper (-60.5 DS")


@pytest.mark.parametrize(
    ("name", "by", "says"),
    [
        ("drop-routing", 40.0, ["drop:routing costs less here than in the paper"]),
        ("drop-speed", 40.0, ["drop:speed costs more here than in the paper"]),
        ("drop-target_point", 62.0, []),  # 62.66 there
    ],
)
def test_a_row_of_the_same_verdict_differs_where_the_interval_leaves_the_paper_out(name, by, says):
    said = sentences(work_out(study(BASELINE, NULL, fallen(name, by))))
    assert [line.partition(" (")[0] for line in said] == says


def test_the_papers_differences_are_those_of_its_table():
    assert TABLE_2["routing"].difference == -74.66
    assert TABLE_2["command"].difference == 1.31
    assert sum(each.verdict == MATTERS for each in TABLE_2.values()) == 5


def test_the_order_of_rows_is_compared_with_the_papers():
    found = work_out(
        study(
            BASELINE,
            NULL,
            *(fallen(f"drop-{name}", -TABLE_2[name].difference) for name in TABLE_2),
            *(fallen(f"zero-{name}", 100 + TABLE_2[name].difference) for name in TABLE_2),
        )
    )
    same, opposite = found.correlations
    assert (same.group, same.rho, same.rows) == ("drop", pytest.approx(1.0), 10)
    assert (opposite.group, opposite.rho) == ("zero", pytest.approx(-1.0))
    assert same.low == pytest.approx(1.0)


def test_the_record_comes_back_whole_and_gives_the_same_again(made, tmp_path):
    keep_study(tmp_path, made)
    again = read_study(tmp_path)
    assert again == made
    assert findings(work_out(again)) == findings(work_out(made))
    content = json.loads((tmp_path / STUDY_FILE).read_text())
    assert content["findings"]["rows"]["drop-map"]["verdict"] == "matters"


def test_table_text_and_figure_are_drawn(made, tmp_path):
    written = write_ablation(tmp_path, work_out(made))
    assert [path.name for path in written] == ["study.md", "study.png"]
    with Image.open(tmp_path / "study.png") as image:
        assert min(image.size) > 200
    text = (tmp_path / "study.md").read_text()
    assert "| drop:map | 49.5 | -40.5 |" in text
    assert "![" in text
    assert "Left out: drop-bev: the policy does not read bev." in text
    console = Console(record=True, width=100)
    console.print(ablation_tables(work_out(made)))
    shown = console.export_text()
    assert "exactly 0" in shown
    assert "matters" in shown


def test_a_study_of_an_agent_that_was_not_isolated_says_so(tmp_path):
    begun = study(row("baseline", drive()), row("null"), row("drop-map"))
    assert NOT_ISOLATED in ablation_markdown(work_out(begun))
    write_study(tmp_path, replace(begun, isolated=True))
    isolated = read_study(tmp_path)
    assert isolated.isolated
    assert NOT_ISOLATED not in ablation_markdown(work_out(isolated))
    path = tmp_path / "study.json"
    earlier = json.loads(path.read_text())
    del earlier["isolated"]  # as before it was kept
    path.write_text(json.dumps(earlier))
    assert read_study(tmp_path) == begun


def test_a_study_that_has_just_begun_can_be_shown_too(tmp_path):
    begun = work_out(study(row("baseline"), row("null"), row("drop-map")))
    assert "baseline" in ablation_markdown(begun)
    assert [path.name for path in write_ablation(tmp_path, begun)] == ["study.md"]


def test_rows_are_chosen_by_row_by_text_or_by_component():
    assert [each.name for each in choose_rows(["drop:map"])] == ["drop-map"]
    assert [each.name for each in choose_rows(["routing"])] == ["drop-routing", "zero-routing"]
    assert [each.name for each in choose_rows(["routing"], "zero")] == ["zero-routing"]
    assert choose_rows() == ABLATION_ROWS
    assert len(ABLATION_ROWS) == 21
    with pytest.raises(StudyError, match="did you mean 'routing'"):
        choose_rows(["rooting"])
    with pytest.raises(StudyError, match="leaves none"):
        choose_rows(["drop-map"], "zero")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: text[: len(text) // 2], "is not whole JSON"),
        (
            lambda text: text.replace('"seeds":', '"seeds": ' + "[" * 100_000),
            "nested deeper than 64",
        ),
        (lambda text: text.replace("90.0", "NaN", 1), "NaN is no number of JSON"),
        (lambda text: text.replace('"name":"baseline"', '"name":"base"'), "every study has one"),
        (
            lambda text: text.replace('"planned":', '"plannd":', 1),
            r"rows\[0\]: unknown field 'plannd'",
        ),
        (
            lambda text: text.replace("driveinsight-study", "other"),
            "its format is not 'driveinsight-study'",
        ),
        (lambda text: text.replace('"format_version": 2', '"format_version": 9'), "version 9"),
        (
            lambda text: text.replace('"town_hash"', '"town_has"'),
            "unknown field 'town_has'; did you mean 'town_hash'",
        ),
        (
            lambda text: text.replace("90.0", '"90"', 1),
            r"rows\[\d\]\.drives\[\d\]\.driving_score: expected a number, got '90'",
        ),
    ],
)
def test_a_broken_record_is_refused_with_what_to_do(made, tmp_path, damage, message):
    keep_study(tmp_path, made)
    path = tmp_path / STUDY_FILE
    path.write_text(damage(path.read_text()))
    with pytest.raises(StudyError, match=message):
        read_study(tmp_path)


def test_a_record_whose_null_row_is_not_its_baseline_is_refused(made):
    null = row("null", *(drive(route, ds=89.0) for route in ROUTES))
    with pytest.raises(StudyError, match="null row of this record is not its baseline on route 0"):
        work_out(study(BASELINE, null))


def test_a_folder_without_a_study_is_refused(tmp_path):
    with pytest.raises(StudyError, match=r"there is no .*study\.json: give the folder"):
        read_study(tmp_path)
