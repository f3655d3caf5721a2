"""Runs whose agent sees something else: recorded, verified, compared, branched, and behaved."""

from __future__ import annotations

import dataclasses
import math
import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest

from agents import loading
from di_envs.edits.text import EditError
from di_envs.edits.world import read_world_edits
from di_envs.route_env import RouteEnv
from di_envs.suites import load_suite
from leaderboard.commands.cli import main
from leaderboard.records.results import ResultsError, read_run, write_run
from leaderboard.records.resuming import resumed
from leaderboard.records.run_json import run_from_json, run_hash, run_to_json
from leaderboard.replaying.branch import branch, branch_run, same_future
from leaderboard.replaying.verify import verify_run
from leaderboard.running.driver import Driver
from leaderboard.running.interventions import read_interventions
from leaderboard.running.jobs import Job, RunSpec, SetupError
from leaderboard.running.runner import new_run
from leaderboard.running.setting_up import run_facts, set_up
from leaderboard.running.wall_clock import Stopwatch
from leaderboard.studies.comparing import compare_runs
from wrappers.interventions.losing import Delay
from wrappers.interventions.presence import Drop
from wrappers.interventions.values import Noise

AGENT = f"{Path(__file__).parents[1] / 'route_followers.py'}:RouteFollower"
ROUTE = "97"
EDITS = "noise:routing,sigma=0.3; delay:speed,steps=2; drop:routing@t>20"
OPTIONS = {"suite": "town05_tiny", "route_ids": (ROUTE,), "traffic": 0, "walkers": 0}


def spec(edits="", agent=AGENT, **options):
    return RunSpec(
        agent=agent, options={**OPTIONS, **options}, interventions=read_interventions(edits)
    )


def driven(edits="", **options):
    """A run of one route."""
    job = Job(index=0, route_id=ROUTE, seed=0)
    with Driver(spec(edits, **options)) as driver:
        record = driver.drive(job)
        run = new_run(driver.spec, [job], load_suite("town05_tiny"), run_facts(driver))
    return dataclasses.replace(run, routes=(record,))


@pytest.fixture(scope="module")
def plain():
    return driven()


@pytest.fixture(scope="module")
def edited():
    return driven(EDITS)


def test_an_edit_that_edits_nothing_is_no_edit_to_the_bit_through_a_whole_route(plain):
    (null,) = driven("identity:all; drop:routing@t>9999").routes
    assert null.interventions == ("identity:all", "drop:routing@t>9999")
    without = dataclasses.replace(null, interventions=())
    assert without.fingerprint() == plain.routes[0].fingerprint()
    assert null.steps > 100


def test_the_same_edits_give_the_same_bits_and_are_recorded(edited):
    assert driven(EDITS).routes[0].fingerprint() == edited.routes[0].fingerprint()
    assert edited.interventions == edited.routes[0].interventions == tuple(EDITS.split("; "))
    assert run_from_json(run_to_json(edited)).interventions == edited.interventions


def test_a_run_without_edits_is_written_as_before_there_were_any(plain):
    assert "interventions" not in run_to_json(plain)
    assert run_hash(plain) != run_hash(dataclasses.replace(plain, interventions=("zero:map",)))


@pytest.mark.parametrize("observations", [False, True])
def test_what_was_driven_on_edited_sight_can_be_verified_with_that_sight(
    edited, tmp_path, observations
):
    write_run(tmp_path, edited)
    verdict = verify_run(read_run(tmp_path), tmp_path, observations=observations)
    assert verdict.stands, [route.problems for route in verdict.routes]
    assert not verdict.problems


def test_edits_that_were_not_made_are_found(edited, tmp_path):
    other = dataclasses.replace(edited.routes[0], interventions=("zero:map",))
    write_run(tmp_path, dataclasses.replace(edited, routes=(other,)))
    verdict = verify_run(read_run(tmp_path), tmp_path, observations=True)
    assert "observation_hash" in " ".join(verdict.routes[0].problems)
    assert "claims the edits 'zero:map'" in verdict.problems[0]


def test_a_run_is_compared_with_its_baseline_and_not_resumed_as_it(plain, edited, tmp_path):
    comparison = compare_runs(plain, edited)
    assert [pair.same_episode for pair in comparison.pairs] == [False]
    write_run(tmp_path, plain)
    with pytest.raises(ResultsError, match="interventions was none, is noise:routing"):
        resumed(tmp_path, dataclasses.replace(edited, routes=()))


def test_a_branch_sees_what_the_recorded_agent_saw(edited):
    futures = branch(edited, edited.routes[0], 4.0, ())
    assert same_future(futures.recorded, futures.edited)


def test_a_branch_into_another_world_is_seen_through_the_same_edits(edited, tmp_path):
    futures = branch(edited, edited.routes[0], 2.0, read_world_edits("force:light=0,state=red"))
    assert futures.edited.interventions == (
        *edited.interventions, "force:light=0,state=red@t=2.0",
    )  # fmt: skip
    write_run(tmp_path, branch_run(edited, futures))
    verdict = verify_run(read_run(tmp_path), tmp_path, observations=True)
    assert verdict.stands, [route.problems for route in verdict.routes]


def off_route_m(run, points):
    """How far to the right of the route each place of a drive is, by the route point beside it."""
    found = {}
    for _, x, y, *_ in run.routes[0].trace:
        point = int(np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - y)))
        dx, dy, yaw = x - points[point, 0], y - points[point, 1], points[point, 3]
        found[point] = dy * math.cos(yaw) - dx * math.sin(yaw)
    return found


def test_a_route_shifted_by_a_lane_moves_the_path_by_a_lane(plain):
    points = RouteEnv(**OPTIONS, observations=("inertial",)).plans[0].points
    shifted = driven("shift:routing,lateral=-3.5")
    for run, expected in ((plain, 0.0), (shifted, -3.5)):
        off = off_route_m(run, points)
        settled = [metres for point, metres in off.items() if 15 <= point < 41]
        assert len(settled) >= 6
        assert np.mean(settled) == pytest.approx(expected, abs=0.5)


def test_an_agent_that_is_told_that_it_stands_goes_faster(plain):
    fooled = driven("set:speed=0")
    top = [max(row[5] for row in run.routes[0].trace) for run in (plain, fooled)]
    assert top[1] > 1.5 * top[0]


def test_an_agent_whose_route_is_dropped_stops_where_it_is(plain):
    lost = driven("drop:routing@route>30%")
    assert 30.0 < lost.routes[0].score.route_completion < 60.0
    assert plain.routes[0].score.route_completion > 90.0


@pytest.mark.parametrize(
    ("edits", "message"),
    [
        ("drop:rooting", "did you mean 'routing'"),
        ("blackout:camera_front", "about nothing that agent .* is shown, and it has no taps"),
        ("mask:bev,p=0.3", "it has no taps that could be edited inside it"),
        ("set:speed=1000", "not 1000"),
    ],
)
def test_what_the_agent_does_not_see_is_refused_before_anything_is_driven(edits, message):
    with pytest.raises(SetupError, match=message):
        set_up(spec(edits), Stopwatch())


def test_privileged_agents_are_said_to_look_past_edits():
    with pytest.warns(UserWarning, match="is privileged: it looks at the world itself"):
        set_up(spec("zero:speed", agent="expert"), Stopwatch())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        set_up(spec(agent="expert"), Stopwatch())


def test_edits_travel_to_other_processes_as_values():
    there = pickle.loads(pickle.dumps(spec(EDITS)))
    assert there == spec(EDITS)
    assert [type(edit) for edit in there.interventions] == [Noise, Delay, Drop]
    assert "; ".join(map(str, there.interventions)) == EDITS


def test_edits_are_checked_against_the_agent_that_says_what_it_requires(monkeypatch):
    made = []
    original = loading._make

    def counted(*arguments):
        made.append(arguments[0])
        return original(*arguments)

    monkeypatch.setattr(loading, "_make", counted)
    with pytest.raises(SetupError, match="no taps that could be edited"):
        set_up(dataclasses.replace(spec("mask:bev,p=0.3"), isolate=False), Stopwatch())
    assert made == [AGENT]


def test_edits_of_the_world_are_sent_to_where_they_belong():
    with pytest.raises(EditError, match="driveinsight branch RUN"):
        read_interventions("drop:routing; remove:actor=3")


def test_a_wrong_edit_ends_the_command_with_what_was_meant(capsys):
    words = ["evaluate", "--agent", AGENT, "--suite", "town05_tiny", "--intervene", "dorp:routing"]
    assert main(words) == 2
    assert "did you mean 'drop'" in capsys.readouterr().err
