"""Pairs by route and seed: what is compared, what is refused, what is left out."""

from __future__ import annotations

import io
from dataclasses import replace

import pytest
from rich.console import Console

from di_envs.rules import CARLA_2_1
from di_envs.world.kinds import EventKind
from leaderboard.commands.cli import main
from leaderboard.records.rescoring import rescored
from leaderboard.records.results import write_run
from leaderboard.scoring.score import Score
from leaderboard.studies.comparing import PairingError, compare_runs
from leaderboard.tables.comparison_table import comparison_tables
from tests.leaderboard.made_records import event, route, run_of

HALF = Score(route_completion=50.0, infraction_score=1.0)
SEVENTY = Score(route_completion=100.0, infraction_score=0.7)
RED, DONE = event(EventKind.RED_LIGHT, time_s=12.3), event(EventKind.COMPLETED)
HIT = event(EventKind.COLLISION_VEHICLE, time_s=40.0)


def runs():
    """Route 7 lost a red light and hit a car; route 8 is as it was; route 9 went further."""
    before = run_of(
        route("7", 0, 0, score=SEVENTY, events=(RED, RED, DONE), route_hash="7", state_hash="a"),
        route("8", 0, 1, events=(DONE,), route_hash="8", state_hash="b"),
        route("9", 0, 2, score=HALF, route_hash="9", state_hash="c"),
    )
    after = run_of(
        route("7", 0, 0, events=(HIT, RED, DONE), route_hash="7", state_hash="d"),
        route("8", 0, 1, events=(DONE,), route_hash="8", state_hash="b"),
        route("9", 0, 2, route_hash="9", state_hash="e"),
        agent="highway",
    )
    return before, after


def text_of(comparison) -> str:
    console = Console(width=140, record=True, file=io.StringIO())
    console.print(comparison_tables(comparison))
    return console.export_text()


def test_the_mean_difference_is_second_less_first_over_pairs():
    comparison = compare_runs(*runs())
    assert comparison.interval("driving_score").value == pytest.approx((30.0 + 0.0 + 50.0) / 3)
    assert comparison.interval("route_completion").value == pytest.approx(50.0 / 3)
    assert comparison.interval("infraction_score").value == pytest.approx(0.1)


def test_which_routes_changed_and_by_which_event_is_named():
    comparison = compare_runs(*runs())
    assert [pair.before.route_id for pair in comparison.changes()] == ["9", "7"]
    text = text_of(comparison)
    assert "no longer: red light (12.3 s); new: vehicle hit (40.0 s)" in text
    assert "route completion 50.0, then 100.0" in text
    assert "3 pairs of route and seed over 3 distinct routes; 2 changed, 1 are the same" in text
    assert "With 3 routes the intervals are likely too narrow" in text


def test_only_events_that_the_rules_list_are_changes():
    """A scenario that began, or a low speed under 1.0, is none."""
    before, after = runs()
    slow = event(EventKind.MIN_SPEED, value=99.0)
    eighth = route("8", 0, 1, events=(event(EventKind.SCENARIO), slow, DONE), route_hash="8")
    after = replace(after, routes=(after.routes[0], eighth, after.routes[2]))
    assert [pair.before.route_id for pair in compare_runs(before, after).changes()] == ["9", "7"]
    both = [rescored(run, CARLA_2_1) for run in (before, after)]
    changes = compare_runs(*both).changes()
    assert [pair.new for pair in changes if pair.before.route_id == "8"] == [(slow,)]


def test_equal_routes_are_one_cluster():
    before, after = runs()
    same = [
        replace(run, routes=tuple(replace(r, route_hash="same") for r in run.routes))
        for run in (before, after)
    ]
    comparison = compare_runs(*same)
    assert comparison.routes == 1
    assert comparison.interval("driving_score").low is None
    assert "One route: nothing can be said of others" in text_of(comparison)


def test_a_run_compared_with_itself_has_no_difference():
    before, _ = runs()
    comparison = compare_runs(before, before)
    interval = comparison.interval("driving_score")
    assert (interval.value, interval.low, interval.high) == (0.0, 0.0, 0.0)
    assert comparison.changes() == []


def test_lost_routes_and_those_of_one_run_only_are_left_out_and_counted():
    before, after = runs()
    lost = replace(after.routes[0], status="Failed - Worker died", reason="killed")
    alone = route("10", 0, 3, route_hash="10")
    comparison = compare_runs(
        replace(before, routes=(*before.routes, alone)),
        replace(after, routes=(lost, *after.routes[1:])),
    )
    assert [pair.before.route_id for pair in comparison.pairs] == ["8", "9"]
    assert (comparison.lost, comparison.unpaired) == (1, 1)
    text = text_of(comparison)
    assert "Left out: 1 that the machinery lost" in text
    assert "Left out: 1 that only one run has" in text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"versions": {"numpy": "2.3.1", "world": "1"}}, r"numpy 2\.4\.6, not 2\.3\.1"),
        ({"versions": {"numpy": "2.4.6", "world": "2"}}, "world 1, not 2"),
        ({"cpu": "avx2"}, "CPU generic, not avx2"),
        ({"suite": "town05_short"}, "suite town05_long, not town05_short"),
        ({"suite_version": 2}, "suite_version 1, not 2"),
        ({"town_hash": "00"}, "the hash of the town's map ff, not 00"),
        ({"options": {"traffic": 4}}, "option 'traffic' 3, not 4"),
        ({"rules": "carla-2.0"}, "pass --rules"),
    ],
)
def test_runs_of_other_worlds_are_refused(change, message):
    before, after = runs()
    with pytest.raises(PairingError, match=message):
        compare_runs(before, replace(after, **change))


OWN = {"suite": "", "suite_version": 0, "world": {"suite": "s", "town": "t", "signals": "map"}}


def test_own_files_are_told_by_what_they_hold_wherever_they_are():
    before, after = runs()
    ours = replace(before, **OWN, options={"town": "/a/one.xodr", "routes": "/a/r.xml"})
    moved = {"suite": "other", "town": "two", "options": {"town": "/b/two.xodr"}}
    theirs = replace(after, **{**OWN, **moved})
    assert len(compare_runs(ours, theirs).pairs) == 3
    with pytest.raises(PairingError, match="content of 'signals' map, not none"):
        compare_runs(ours, replace(theirs, world={**OWN["world"], "signals": "none"}))


def test_another_python_and_what_only_one_driver_rests_on_are_no_obstacle():
    before, after = runs()
    other = {**after.versions, "python": "3.12", "driveinsight": "0.2", "torch": "2.13.0"}
    assert len(compare_runs(before, replace(after, versions=other)).pairs) == 3


def test_two_drivers_that_learnt_rest_on_the_same_torch():
    before, after = (
        replace(run, versions={**run.versions, "torch": version})
        for run, version in zip(runs(), ("2.13.0", "2.12.0"), strict=True)
    )
    with pytest.raises(PairingError, match=r"torch 2\.13\.0, not 2\.12\.0"):
        compare_runs(before, after)


def test_what_only_the_agent_sees_may_differ():
    before, after = runs()
    seen = replace(after, options={"traffic": 3, "weather": "HardRainNoon", "route_ids": ["7"]})
    assert len(compare_runs(before, seen).pairs) == 3


def test_another_route_under_the_same_id_is_refused():
    before, after = runs()
    other = replace(after.routes[1], route_hash="another")
    with pytest.raises(PairingError, match="route 8 is not the same route"):
        compare_runs(before, replace(after, routes=(other,)))


def test_runs_without_a_common_route_are_refused():
    before, after = runs()
    with pytest.raises(PairingError, match="share no route and seed"):
        compare_runs(before, replace(after, routes=(route("77", route_hash="77"),)))


def test_the_command_prints_tables_and_the_next_step(tmp_path, capsys):
    before, after = runs()
    write_run(tmp_path / "a", before)
    write_run(tmp_path / "b", after)
    assert main(["compare", str(tmp_path / "a"), str(tmp_path / "b")]) == 0
    shown = capsys.readouterr().out
    assert "expert and highway on town05_long · rules carla-1.0" in shown
    assert f"Next: driveinsight verify {tmp_path / 'b'}" in shown
    assert main(["compare", str(tmp_path / "a"), str(tmp_path / "c")]) == 2
    assert main(["compare", str(tmp_path / "a"), str(tmp_path / "b"), "--rules", "carla-3"]) == 2
    assert main(["compare", str(tmp_path / "a"), str(tmp_path / "b"), "--rules", "carla-2.1"]) == 0
    assert "rules carla-2.1" in capsys.readouterr().out
