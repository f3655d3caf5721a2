"""Which moments of a branch are shown: those around what tells its futures apart, to the tick."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from PIL import Image, ImageColor

from di_envs.edits.world import RemoveActor
from di_envs.world.kinds import EventKind
from leaderboard.pages.branch_moments import edited_actors, moments_of, shown_times, telling_event
from leaderboard.pages.branch_picture import MARK, PANEL_PX, write_branch_picture
from leaderboard.records.record import EventRecord
from leaderboard.replaying.branch import Branch, branch, branch_run
from tests.leaderboard.short_drives import short_run


@pytest.fixture(scope="module")
def run():
    return short_run("constant", 12, traffic=3, walkers=1)


def hit(time_s, kind=EventKind.COLLISION_VEHICLE):
    return EventRecord(kind=kind, tick=round(time_s / 0.05), time_s=time_s, x=0.0, y=0.0, z=0.0)


def branched(run, at_s, recorded=(), edited=()):
    record = run.routes[0]
    return Branch(
        at_s=at_s,
        edits=(),
        recorded=dataclasses.replace(record, events=(*record.events, *recorded)),
        edited=dataclasses.replace(record, events=(*record.events, *edited)),
    )


def test_the_first_infraction_that_one_future_has_alone_is_what_is_shown(run):
    both, alone, pace = hit(4.0), hit(6.65), hit(5.0, EventKind.MIN_SPEED)
    apart = branched(run, 3.0, recorded=(both, pace, alone), edited=(both,))
    assert telling_event(run, apart) == alone
    assert shown_times(run, apart) == pytest.approx((3.0, 5.65, 6.65, 8.65))
    soon = branched(run, 6.0, recorded=(alone,))
    assert shown_times(run, soon) == pytest.approx((6.0, 6.65, 8.65))
    same = branched(run, 3.0, recorded=(both,), edited=(both,))
    assert shown_times(run, same) == (3.0, 5.0, 7.0, 11.0)


def test_a_moment_within_a_decision_is_shown_at_its_tick_and_changes_nothing(run):
    record = run.routes[0]
    whole, half, after = moments_of(run, record, (0.8, 0.85, 0.9), ())
    assert (whole.time_s, half.time_s, after.time_s) == pytest.approx((0.8, 0.85, 0.9))
    steps = np.diff([whole.place, half.place, after.place], axis=0)
    assert np.hypot(*steps.T) == pytest.approx([np.hypot(*steps.T).mean()] * 2, rel=0.2)
    (alone,) = moments_of(run, record, (0.9,), ())
    assert alone.place == after.place  # to the bit
    (late,) = moments_of(run, record, (99.0,), ())
    assert late.time_s == pytest.approx(record.game_s)


def test_who_was_removed_is_in_one_future_and_named_in_the_picture(run, tmp_path):
    real = branch(run, run.routes[0], 0.5, (RemoveActor(actor=1),))
    assert edited_actors(real) == (1,)
    (there,) = moments_of(run, real.recorded, (0.5,), (1,))
    (gone,) = moments_of(branch_run(run, real), real.edited, (0.5,), (1,))
    assert there.place == gone.place
    assert (there.bodies.keys(), gone.bodies.keys()) == ({1}, set())
    path = tmp_path / "branch.png"
    write_branch_picture(path, run, real)
    with Image.open(path) as picture:
        width, height = picture.size
        legend = np.asarray(picture)[height - 34 :].reshape(-1, 3)
    assert width == 4 * (PANEL_PX + 8) + 8
    assert (legend == ImageColor.getrgb(MARK)).all(axis=1).any()
