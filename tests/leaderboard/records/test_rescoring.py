"""A finished run under other rules: from its events alone, by hand-worked numbers."""

from __future__ import annotations

import pytest

from di_envs.rules import CARLA_1_0, CARLA_2_0, CARLA_2_1, DI_1_0
from di_envs.world.kinds import EventKind
from leaderboard.commands.cli import main
from leaderboard.records.record import AGENT_CRASHED, WORKER_DIED
from leaderboard.records.rescoring import rescored, rescored_route
from leaderboard.records.results import read_run, write_run
from leaderboard.scoring.score import Score
from tests.leaderboard.made_records import event, route, run_of

EVENTS = (
    event(EventKind.RED_LIGHT),
    event(EventKind.MIN_SPEED, value=50.0),
    event(EventKind.COMPLETED),
)
DRIVEN = route(score=Score(route_completion=100.0, infraction_score=0.7), events=EVENTS)


def test_a_red_light_at_half_the_traffics_pace_under_each_rule_set():
    assert rescored_route(DRIVEN, CARLA_1_0) == DRIVEN
    assert rescored_route(DRIVEN, CARLA_2_0).score.infraction_score == pytest.approx(0.7 * 0.85)
    assert rescored_route(DRIVEN, CARLA_2_1).score.infraction_score == pytest.approx(1 / 1.6)


HIT_TWICE = (
    *(event(EventKind.FIRST_HIT_VEHICLE), event(EventKind.COLLISION_VEHICLE)),
    *(event(EventKind.COLLISION_VEHICLE), event(EventKind.COMPLETED)),
)
OF_WORLD_2 = {"python": "3.11", "numpy": "2.4.6", "world": "2"}


def test_a_body_hit_twice_counts_once_under_di_1_0_from_the_same_record():
    run = run_of(
        route(score=Score(route_completion=100.0, infraction_score=0.36), events=HIT_TWICE),
        versions=OF_WORLD_2,
    )
    ours = rescored(run, DI_1_0)
    assert ours.routes[0].score.driving_score == pytest.approx(60.0)
    assert rescored(ours, CARLA_1_0) == run


def test_a_run_of_a_world_that_did_not_record_what_di_1_0_counts_is_refused():
    with pytest.raises(ValueError, match="from version 2 on, and this run is of version 1"):
        rescored(run_of(DRIVEN), DI_1_0)


def test_there_and_back_again_is_the_same_to_the_bit():
    run = run_of(DRIVEN, route(index=1, events=(event(EventKind.COMPLETED),)))
    assert rescored(rescored(run, CARLA_2_1), CARLA_1_0) == run


def test_a_flawless_route_is_perfect_under_2_x():
    flawless = route(events=(event(EventKind.SCENARIO, value=3.0), event(EventKind.COMPLETED)))
    assert rescored_route(flawless, CARLA_2_0).status == "Perfect"
    assert rescored_route(flawless, CARLA_1_0).status == "Completed"


def test_an_agent_that_crashed_keeps_its_status_and_what_it_had_done():
    crashed = route(
        status=AGENT_CRASHED,
        reason="KeyError",
        score=Score(route_completion=40.0, infraction_score=0.7),
        done_m=400.0,
        events=EVENTS[:1],
    )
    found = rescored_route(crashed, CARLA_2_1)
    assert found.status == AGENT_CRASHED
    assert found.score.driving_score == pytest.approx(40.0 / 1.4)


def test_a_lost_route_stays_as_it_is():
    lost = route(status=WORKER_DIED, reason="killed")
    assert rescored_route(lost, CARLA_2_1) is lost


def test_the_command_shows_both_and_writes_what_is_asked_for(tmp_path, capsys):
    write_run(tmp_path / "run", run_of(DRIVEN))
    arguments = ["score", str(tmp_path / "run"), "--rules", "carla-2.1"]
    assert main(arguments) == 0
    shown = capsys.readouterr().out
    assert "carla-1.0 and carla-2.1" in shown
    assert "-7.5" in shown  # 70 becomes 62.5
    assert "Nothing was written" in shown
    assert main([*arguments, "--output", str(tmp_path / "other")]) == 0
    assert read_run(tmp_path / "other") == rescored(run_of(DRIVEN), CARLA_2_1)
    assert main([*arguments, "--output", str(tmp_path / "other")]) == 2
    assert main(["score", str(tmp_path / "run"), "--rules", "carla-2"]) == 2
    assert "did you mean" in capsys.readouterr().err
