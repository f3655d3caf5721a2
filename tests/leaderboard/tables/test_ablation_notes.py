"""The notes below an ablation: each stands there when it applies, and only then."""

from __future__ import annotations

import dataclasses

import pytest

from leaderboard.studies.ablation import work_out
from leaderboard.tables.ablation_notes import notes
from tests.leaderboard.studies.drives_here import drive, row, study

SOMETIMES = {
    "low": "no row can fall by more",
    "same": "rule of three",
    "few": "likely too narrow",
    "one": "One route: there are no intervals",
    "missing": "Not complete: drop-map: 11 of 12 drives.",
    "out": "Left out: drop-bev: it reads none.",
    "order": "Spearman's rank correlation with the paper, drop rows",
}


def drives(count, ds, by=1.0):
    return [drive(str(number), ds=ds - by * number) for number in range(count)]


def noted(*rows):
    text = "\n".join(notes(work_out(study(*rows))))
    return {name for name, part in SOMETIMES.items() if part in text}


def beside(count=12, ds=90.0):
    """The baseline and the null row."""
    return [row(name, *drives(count, ds)) for name in ("baseline", "null")]


def test_a_study_of_a_good_agent_over_many_routes_needs_no_caution():
    assert noted(*beside(), row("drop-map", *drives(12, 60.0))) == set()


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([*beside(12, 12.0), row("drop-map", *drives(12, 11.5))], {"low"}),
        ([*beside(), row("drop-map", *drives(12, 90.0))], {"same"}),
        ([*beside(4), row("drop-map", *drives(4, 60.0))], {"few"}),
        ([*beside(1), row("drop-map", *drives(1, 60.0))], {"one"}),
        ([*beside(), row("drop-bev", left_out="it reads none")], {"out"}),
        (
            [*beside(), dataclasses.replace(row("drop-map", *drives(11, 60.0)), planned=12)],
            {"missing"},
        ),
        (
            [
                *beside(),
                *(
                    row(f"drop-{name}", *drives(12, ds))
                    for name, ds in (("map", 80.0), ("bev", 50.0), ("speed", 70.0))
                ),
            ],
            {"order"},
        ),
    ],
)
def test_each_caution_stands_there_when_it_applies(rows, expected):
    assert noted(*rows) == expected


def test_the_time_of_all_rows_is_added_up():
    last = notes(work_out(study(*beside(), row("drop-map", *drives(12, 60.0)))))[-1]
    assert last.startswith("Driven in 72 s of wall-clock time")  # 3 rows of 12 drives of 2 s
