"""The table of a run: scores, bound and what happened, on a terminal as narrow as they come."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from di_envs.world.kinds import EventKind
from leaderboard.records.record import LOST, RunRecord
from leaderboard.scoring.score import Score
from leaderboard.tables.run_tables import driving_interval, print_run
from tests.leaderboard.made_records import RED, event, lost, route, run_of


def test_in_eighty_columns_no_word_of_what_happened_is_broken():
    kinds = (EventKind.COLLISION_VEHICLE, EventKind.OUTSIDE_LANES, EventKind.ROUTE_DEVIATION)
    records = [
        route(
            "town05_long_12",
            seed=seed,
            index=seed,
            score=Score(route_completion=100.0 - 10.0 * seed, infraction_score=0.5),
            events=tuple(event(kind) for kind in kinds),
        )
        for seed in range(3)
    ]
    console = Console(file=io.StringIO(), width=80)
    print_run(run_of(*records, seeds=(0, 1, 2)), console)
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    words = console.file.getvalue().replace("│", " ").split()
    for word in ("town05_long_12", "vehicle", "outside", "lanes,", "45.0", "12.4"):
        assert word in words, console.file.getvalue()


def _text(run: RunRecord) -> str:
    console = Console(width=120, record=True, file=io.StringIO())
    print_run(run, console)
    return console.export_text()


def test_the_table_shows_scores_bound_track_and_what_happened():
    text = _text(run_of(RED, seeds=(0,)))
    assert "expert on town05_long · track PRIVILEGED · rules carla-1.0" in text
    row = next(line for line in text.splitlines() if line.startswith("│ 7 "))
    assert [cell.strip() for cell in row.strip("│").split("│")] == [
        "7",
        "35.0",
        "50.0",
        "0.70",
        "100.0",
        "2.00",
        "1 red light, 1 timeout",
    ]
    assert "one seed (0): no confidence interval" in text
    assert "DS under di-1.0 is not known" in text


def test_the_table_has_the_score_by_our_rules_beside_that_by_carla_s():
    twice = [event(EventKind.COLLISION_VEHICLE)] * 2 + [event(EventKind.FIRST_HIT_VEHICLE)]
    hit = route(score=Score(route_completion=100.0, infraction_score=0.36), events=tuple(twice))
    text = _text(run_of(hit, seeds=(0,), versions={"world": "2"}))
    row = next(line for line in text.splitlines() if line.startswith("│ 7 "))
    assert [cell.strip() for cell in row.strip("│").split("│")][1:3] == ["36.0", "60.0"]
    assert "is not known" not in text


def test_the_table_counts_the_scenarios_that_began_by_type():
    text = _text(run_of(route(scenarios={"3": 2, "10": 1}), route(index=1, scenarios={"3": 1})))
    rows = [line for line in text.splitlines() if line.startswith(("│ S3 ", "│ S10 "))]
    assert [row.split()[-2] for row in rows] == ["3", "1"]
    assert "scenarios that began" not in _text(run_of(route()))


def test_the_interval_is_over_seed_means():
    routes = [
        route(
            route_id=name,
            seed=seed,
            index=index,
            score=Score(route_completion=completion, infraction_score=1.0),
        )
        for index, (name, seed, completion) in enumerate(
            [("a", 0, 100.0), ("a", 1, 80.0), ("b", 0, 60.0), ("b", 1, 60.0)]
        )
    ]
    interval = driving_interval(run_of(*routes))  # seed means 80 and 70
    assert interval.mean == 75.0
    assert interval.half_width == pytest.approx(12.7062 * 5.0)
    assert "± is the 95 % t-interval of the means of 2 seeds" in _text(run_of(*routes))


def test_a_crash_is_in_the_table_and_an_unfinished_run_says_so():
    crashed = route(status="Failed - Agent crashed", reason="act returned throttle NaN")
    text = _text(run_of(crashed, planned=2))
    assert "1 Agent crashed" in text
    assert "Not complete: 1 of 2" in text
    assert "no route was finished" in _text(run_of(planned=2))


@pytest.mark.parametrize("status", sorted(LOST))
def test_a_lost_route_stands_apart_in_the_table(status):
    run = run_of(route(), lost(status))
    text = _text(run)
    assert f"1 lost ({status.removeprefix('Failed - ')})" in text
    assert "Left out of every mean: 1 of 2 routes x seeds" in text
    assert driving_interval(run).mean == 100.0
    assert "--resume" in _text(run_of(lost(status)))
