"""Explained routes: arrays that are the policy's own, futures that begin at the same state."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from agents.explain.look import look_at
from di_envs.edits.text import EditError
from di_envs.edits.world import MoveActor, read_world_edits
from leaderboard.explaining.explanation import ExplainError
from leaderboard.explaining.questions import questions_about, read_asked
from leaderboard.explaining.route import explain_route
from leaderboard.pages.explain_tables import path_moves_m
from leaderboard.records.chosen_route import RouteChoiceError
from leaderboard.replaying.branch import branch, branch_run
from leaderboard.replaying.recorded_agent import RetraceError, retrace_env, run_agent
from leaderboard.replaying.replay import ReplayError
from leaderboard.replaying.retracing import retrace
from tests.leaderboard.short_drives import short_run
from tests.leaderboard.untrained import save_untrained

DECISIONS = 16
BUSY = {"traffic": 8, "walkers": 4}
AT = 8  # decisions before the moment that is asked about
AHEAD_S = 0.5
EDITS = ("identity:all", "set:speed=20", "noise:bev,sigma=5", "move:actor=1,ahead=3")

HIDING = '''
import numpy as np

from agents.base import Requirements, make_control


class Hiding:
    """Turns further the longer it has driven, and tells nobody how long that is."""

    requires = Requirements(branchable=False)

    def start(self, plan, seed):
        self._acts = 0

    def act(self, observation, memory):
        self._acts += 1
        pedal = 0.5 if observation["speed"][0] < 5.0 else 0.0
        return make_control(pedal, self._acts / 100.0, 0.0), None

    def close(self):
        pass
'''


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The start of a drive with an untrained policy that has a camera and BEV features."""
    folder = tmp_path_factory.mktemp("policy")
    save_untrained(folder, "tiny")
    return short_run(f"driveinsight:{folder}", DECISIONS, **BUSY)


@pytest.fixture(scope="module")
def explained(run):
    return explain_route(
        run,
        run.routes[0].route_id,
        every_s=0.3,
        at_s=AT * 0.1,
        what_if="; ".join(EDITS),
        ahead_s=AHEAD_S,
    )


def test_each_moments_arrays_are_what_a_look_at_it_shows(run, explained):
    assert explained.decisions.tolist() == [0, 3, 6, 8, 9, 12, 15]
    assert explained.times_s == pytest.approx(explained.decisions * 0.1)
    env = retrace_env(run, front=True)
    agent = run_agent(run, env)
    for decision in retrace(run, run.routes[0], agent=agent, env=env):
        if decision.number not in explained.decisions:
            continue
        i = explained.decisions.tolist().index(decision.number)
        look = look_at(agent, decision.seen, decision.memory)
        assert explained.groups == look.response.groups
        assert np.array_equal(explained.gradient[i], look.response.gradient)
        assert np.array_equal(explained.attention[i], look.response.attention)
        assert np.array_equal(explained.waypoints[i], look.response.waypoints)
        assert explained.maps.keys() == look.maps.keys() == {"bev", "camera_front"}
        for name, maps in explained.maps.items():
            assert np.array_equal(maps.values[i], look.maps[name])
        assert np.array_equal(explained.controls[i], decision.control)
        state = decision.step.view.state
        assert explained.poses[i].tolist() == [state.x[0], state.y[0], state.yaw[0]]
        for name, told in explained.seen.items():
            assert np.array_equal(told[i], decision.seen[name])
    assert explained.missing == ()
    assert len(explained.images) == 7
    assert all(image.startswith(b"\xff\xd8") for image in explained.images)  # JPEG


def test_an_edit_that_edits_nothing_is_the_drive_as_it_was_to_the_bit(run, explained):
    base, same = explained.what_if.base, explained.what_if.answers[0]
    assert same.edit == "identity:all"
    for name in ("controls", "checks"):
        assert np.array_equal(getattr(base.future, name), getattr(same.future, name))
    for name in ("gradient", "attention", "waypoints"):
        one, other = getattr(base.look.response, name), getattr(same.look.response, name)
        assert np.array_equal(one, other)
        assert np.array_equal(one, getattr(explained, name)[explained.what_if.moment])
    assert path_moves_m(same, base) == 0.0
    one, other = base.future.film.columns(), same.future.film.columns()
    assert one.keys() == other.keys()
    assert all(np.array_equal(one[name].values, other[name].values) for name in one)
    record = run.routes[0]
    until = AT + round(AHEAD_S / 0.1)
    assert np.array_equal(same.future.controls, record.control_array()[AT:until])
    assert np.array_equal(same.future.checks, record.check_array()[AT : until + 1])
    assert same.future.end_s == base.future.end_s == pytest.approx(until * 0.1)
    assert same.future.driving_score == base.future.driving_score


def test_edits_of_what_is_seen_of_the_policy_and_of_the_world_change_what_they_are_of(explained):
    what_if = explained.what_if
    assert [answer.edit for answer in what_if.answers] == list(EDITS)
    _, speed, noise, moved = what_if.answers
    assert speed.future.seen["speed"] == 20.0
    assert path_moves_m(speed, what_if.base) > 0.0
    assert path_moves_m(noise, what_if.base) > 0.0
    assert noise.future.checks[0] == what_if.base.future.checks[0]  # it sees the same at first
    places = [np.asarray(a.future.film.columns()["actor_x"].values) for a in (what_if.base, moved)]
    assert not np.array_equal(*places)


def test_an_edit_asked_about_draws_what_a_run_with_it_draws_however_it_is_written(run):
    what_if = explain_route(
        run,
        run.routes[0].route_id,
        every_s=9,
        at_s=0.2,
        what_if="noise:bev,sigma=5; noise:bev,sigma=5.00,seed=0",
        ahead_s=0.2,
    ).what_if
    one, other = what_if.answers
    assert one.edit == other.edit == "noise:bev,sigma=5"
    assert np.array_equal(one.look.response.waypoints, other.look.response.waypoints)


def test_questions_can_be_asked_as_values(run):
    env = retrace_env(run)
    asked = read_asked("set:speed=3@junction<20m; move:actor=1,ahead=3")
    seen, moved = questions_about(asked, 0.8, run, env)
    assert seen.seen.texts == ("set:speed=3@junction<20m&t>0.75",)
    assert (moved.world, moved.text) == (MoveActor(actor=1, ahead_m=3.0), "move:actor=1,ahead=3")


def test_a_drive_to_its_end_keeps_its_status(run):
    explained = explain_route(
        run, run.routes[0].route_id, every_s=9, at_s=1.5, what_if="identity:all", ahead_s=9
    )
    record, future = run.routes[0], explained.what_if.base.future
    assert future.status == record.status
    assert future.end_s == record.game_s
    assert future.driving_score == pytest.approx(record.score.driving_score)


def test_an_agent_that_hides_its_memory_drives_there_again_for_every_edit(tmp_path):
    path = tmp_path / "hiding.py"
    path.write_text(HIDING)
    run = short_run(f"{path}:Hiding", DECISIONS)
    asked = {"at_s": 0.8, "what_if": "identity:all; set:speed=30; identity:map", "ahead_s": 0.5}
    explained = explain_route(run, run.routes[0].route_id, **asked)
    base = explained.what_if.base.future.controls
    first, fast, again = (answer.future.controls for answer in explained.what_if.answers)
    assert np.array_equal(first, base)
    assert np.array_equal(again, base)
    assert base[:, 1] == pytest.approx(np.arange(9, 14) / 100.0)
    assert fast[:, 0].max() == 0.0 < base[:, 0].min()
    assert explained.groups == ()
    assert explained.gradient.shape == (0, 0, 2)
    assert "has no torch policy that says where its tokens are" in explained.missing[0]
    assert "The agent has no camera" in explained.missing[1]


def test_what_an_edit_remembers_is_from_before_the_moment(run):
    explained = explain_route(
        run,
        run.routes[0].route_id,
        every_s=0.1,
        at_s=0.8,
        what_if="delay:speed,steps=5",
        ahead_s=0.1,
    )
    (answer,) = explained.what_if.answers
    assert answer.future.seen["speed"] == explained.seen["speed"][3]
    assert explained.seen["speed"][3] != explained.seen["speed"][8]


def test_a_world_that_was_edited_later_is_edited_in_the_futures_too():
    run = short_run("constant", DECISIONS, **BUSY)
    edits = read_world_edits("; ".join(f"remove:actor={i}" for i in range(1, 6)))
    edited = branch_run(run, branch(run, run.routes[0], 1.0, edits))
    asked = {"at_s": 0.8, "what_if": "identity:all", "ahead_s": 0.5}
    explained = explain_route(edited, edited.routes[0].route_id, **asked)
    (same,) = explained.what_if.answers
    checks = edited.routes[0].check_array()[8:14]
    assert np.array_equal(same.future.checks, checks)
    assert not np.array_equal(checks[2:], run.routes[0].check_array()[10:14])


@pytest.mark.parametrize(
    ("route", "asked", "error", "message"),
    [
        ("77", {}, RouteChoiceError, "no route 77 with seed 0; its routes: "),
        (None, {"seed": 4}, RouteChoiceError, "its seeds: 0"),
        (None, {"at_s": 1.6}, ExplainError, "was driven to 1.6 s: .* between 0 and 1.5 s"),
        (None, {"at_s": -0.1}, ExplainError, "not -0.1 s"),
        (None, {"what_if": "drop:map"}, ExplainError, "say at which moment"),
        (None, {"ahead_s": -1.0}, ExplainError, "ahead_s must be more than 0"),
        (None, {"every_s": 0.0}, ExplainError, "every_s must be more than 0"),
        (None, {"at_s": 1.0, "what_if": "drop"}, EditError, "cannot read the edit 'drop'"),
        (None, {"at_s": 1.0, "what_if": "dorp:map"}, EditError, "did you mean 'drop'"),
        (None, {"at_s": 1.0, "what_if": "drop:mpa"}, EditError, "mpa"),
        (None, {"at_s": 1.0, "what_if": "remove:actor=999"}, EditError, "no actor 999"),
        (None, {"at_s": 1.0, "what_if": "remove:actor=1@t>3"}, EditError, "leave out @t>3"),
    ],
)
def test_what_cannot_be_explained_is_refused_with_what_to_do(run, route, asked, error, message):
    with pytest.raises(error, match=message):
        explain_route(run, route or run.routes[0].route_id, **asked)


def test_a_run_of_another_town_or_other_weights_is_refused(run, tmp_path):
    elsewhere = dataclasses.replace(run, town_hash="00")
    with pytest.raises(ReplayError, match="driven in a town with hash 00"):
        explain_route(elsewhere, run.routes[0].route_id)
    save_untrained(tmp_path, "tiny", seed=1)
    other = dataclasses.replace(run, agent=f"driveinsight:{tmp_path}")
    with pytest.raises(RetraceError, match="acts otherwise than recorded: the code or the weights"):
        explain_route(other, run.routes[0].route_id)
