"""Branches: the recorded future comes out again unless the world is changed, and then another."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from PIL import Image

from di_envs.edits.text import EditError
from di_envs.edits.world import read_world_edits
from di_envs.suites import load_suite
from di_envs.world.kinds import EventKind
from leaderboard.commands.cli import main
from leaderboard.records.packing import pack
from leaderboard.records.record import CONTROL_TYPE, RunRecord
from leaderboard.records.results import read_run, write_run
from leaderboard.replaying.branch import BranchError, branch, branch_run, same_future
from leaderboard.replaying.replay import replay, replay_env
from leaderboard.replaying.verify import verify_run
from leaderboard.running.jobs import Job, RunSpec
from leaderboard.running.runner import new_run
from leaderboard.running.setting_up import run_facts, set_up
from leaderboard.running.wall_clock import Stopwatch
from leaderboard.tables.branch_text import branch_tables

SUITE = "town05_tiny"
ROUTE = "60"  # a turn onto a street on which a bus comes

HIDING_AGENT = '''
from agents.base import Requirements
from agents.expert.agent import Expert


class Hiding:
    """The blind expert with its memory out of sight."""

    requires = Requirements(privileged=True, branchable=False)

    def __init__(self):
        self._expert = Expert(ignore_actors=True)

    def start(self, plan, seed):
        self._memory = self._expert.start(plan, seed)

    def act(self, observation, memory):
        control, self._memory = self._expert.act(observation, self._memory)
        return control, None

    def close(self):
        pass
'''


def driven(agent: str) -> RunRecord:
    """A run of one route."""
    spec = RunSpec(agent=agent, options={"suite": SUITE, "route_ids": (ROUTE,)})
    job = Job(index=0, route_id=ROUTE, seed=0)
    with set_up(spec, Stopwatch()) as driver:
        scene = run_facts(driver)
        record = driver.drive(job)
    run = new_run(spec, [job], load_suite(SUITE), scene)
    return dataclasses.replace(run, routes=(record,))


@pytest.fixture(scope="module")
def run() -> RunRecord:
    return driven("expert-blind")


@pytest.fixture(scope="module")
def hit(run):
    """The collision with the bus."""
    return next(e for e in run.routes[0].events if e.kind == EventKind.COLLISION_VEHICLE)


def test_a_branch_without_edits_is_the_recorded_future_to_the_bit(run):
    futures = branch(run, run.routes[0], 4.0, ())
    assert same_future(futures.recorded, futures.edited)


def test_removing_the_actor_that_was_hit_removes_that_collision(run, hit):
    edits = read_world_edits(f"remove:actor={hit.other}")
    futures = branch(run, run.routes[0], hit.time_s - 3.0, edits)
    assert futures.edited.interventions == (f"remove:actor={hit.other}@t={hit.time_s - 3.0!r}",)
    kinds = [event.kind for event in futures.edited.events]
    assert EventKind.COLLISION_VEHICLE not in kinds
    assert futures.edited.score.driving_score > futures.recorded.score.driving_score
    # What came before is as it was.
    shared = round((hit.time_s - 3.0) / 0.1)
    controls = futures.recorded.control_array(), futures.edited.control_array()
    assert np.array_equal(controls[0][:shared], controls[1][:shared])


def test_a_branched_drive_can_be_written_replayed_and_verified(run, hit, tmp_path):
    edits = read_world_edits(f"remove:actor={hit.other}; change:weather=WetNoon")
    edited = branch_run(run, branch(run, run.routes[0], 2.0, edits))
    write_run(tmp_path, edited)
    verdict = verify_run(read_run(tmp_path), tmp_path)
    assert verdict.stands, [route.problems for route in verdict.routes]
    without = dataclasses.replace(edited.routes[0], interventions=())
    write_run(tmp_path, dataclasses.replace(edited, routes=(without,)))
    assert not verify_run(read_run(tmp_path), tmp_path).stands


def test_a_branch_of_a_branch_keeps_what_was_done_to_the_world_later(run, hit):
    edits = read_world_edits(f"remove:actor={hit.other}")
    edited = branch_run(run, branch(run, run.routes[0], 4.0, edits))
    again = branch(edited, edited.routes[0], 2.0, ())
    assert same_future(again.recorded, again.edited)
    removed = f"remove:actor={hit.other}@t=4.0"
    dark = branch(edited, edited.routes[0], 2.0, read_world_edits("change:weather=WetNoon"))
    assert dark.edited.interventions == (removed, "change:weather=WetNoon@t=2.0")
    assert dark.edited.state_hash == edited.routes[0].state_hash  # this agent sees no weather
    gone = branch(edited, edited.routes[0], 2.0, ())
    assert gone.edited.events == edited.routes[0].events


def test_a_run_scored_by_other_rules_than_its_environment_branches_into_its_own_rewards(run):
    scored = dataclasses.replace(run, rules="carla-2.1")  # its options name none
    edited = branch(scored, run.routes[0], 8.0, ()).edited
    assert edited.reward_hash == run.routes[0].reward_hash


def test_an_edit_changes_the_world_between_two_decisions(run, hit):
    edited = branch_run(
        run, branch(run, run.routes[0], 2.0, read_world_edits("force:light=0,state=red"))
    )
    env = replay_env(edited)
    shown = [int(step.view.state.light[0]) for step in replay(edited, edited.routes[0], env=env)]
    assert set(shown[20:]) == {3}


def test_an_agent_that_hides_its_memory_is_driven_there_again(tmp_path):
    path = tmp_path / "hiding.py"
    path.write_text(HIDING_AGENT)
    run = driven(f"{path}:Hiding")
    futures = branch(run, run.routes[0], 5.0, ())
    assert same_future(futures.recorded, futures.edited)


def test_an_agent_that_acts_otherwise_than_recorded_is_not_branched(run):
    record = run.routes[0]
    controls = record.control_array().copy()
    controls[7, 0] = np.nextafter(controls[7, 0], np.float32(2.0))
    altered = dataclasses.replace(record, controls=pack(controls, CONTROL_TYPE))
    with pytest.raises(BranchError, match=r"at 0\.7 s the agent acts otherwise than recorded"):
        branch(run, altered, 2.0, ())


@pytest.mark.parametrize("at_s", [-1.0, 8000.0])
def test_a_moment_that_was_not_driven_is_refused(run, at_s):
    with pytest.raises(BranchError, match=r"was driven to \d+\.\d+ s: branch it between 0 and"):
        branch(run, run.routes[0], at_s, ())


def test_an_edit_that_cannot_be_made_ends_the_branch_with_its_reason(run):
    with pytest.raises(EditError, match="there is no actor 5000 at this moment; nearest"):
        branch(run, run.routes[0], 2.0, read_world_edits("remove:actor=5000"))


def test_the_command_shows_both_futures_and_writes_a_picture(run, hit, tmp_path, capsys):
    folder = tmp_path / "run"
    folder.mkdir()
    write_run(folder, run)
    as_it_was = ["branch", str(folder), "--route", ROUTE, "--at", "3"]
    asked = [*as_it_was, "--world"]
    assert main([*asked, f"remove:actor={hit.other}"]) == 0
    out = capsys.readouterr().out
    assert "as recorded" in out
    assert all(f"driveinsight {step} {folder}" in out for step in ("report", "verify"))
    branched = folder / "branch-60-3s"
    assert np.asarray(Image.open(branched / "branch.png")).std() > 20.0
    assert json.loads((branched / "results.json").read_text())["entry_status"] == "Finished"
    assert main(as_it_was) == 0
    assert "Both futures are the same, to the bit." in capsys.readouterr().out
    assert main([*asked, "remove:actr=3"]) == 2
    assert "did you mean 'remove:actor'" in capsys.readouterr().err
    as_it_was[3] = "7"
    assert main(as_it_was) == 2
    assert "the run has no route 7 with seed 0; its routes: 60" in capsys.readouterr().err


def test_the_tables_tell_which_events_are_only_in_one_future(run, hit):
    futures = branch(run, run.routes[0], 3.0, read_world_edits(f"remove:actor={hit.other}"))
    _, events = branch_tables(futures)
    cells = [list(column.cells) for column in events.columns]
    row = next(i for i, cell in enumerate(cells[1]) if "vehicle hit" in cell)
    assert cells[2][row] == ""
