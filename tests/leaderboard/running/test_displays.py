"""What a person sees of work under way: all bars look alike, and tell what they are for."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from leaderboard.records.record import AGENT_CRASHED
from leaderboard.running.displays.compile_bar import COMPILING, CompileBar
from leaderboard.running.displays.run import RunDisplay
from leaderboard.running.displays.study import StudyDisplay
from leaderboard.running.displays.training import TrainingDisplay
from leaderboard.running.displays.work_bar import EACH, work_bar
from leaderboard.running.jobs import Job
from leaderboard.running.messages import Compiling
from tests.leaderboard.made_records import route

JOB = Job(index=0, route_id="7", seed=0)


@pytest.fixture
def console():
    return Console(file=io.StringIO(), width=200)


def shown(console):
    return console.file.getvalue()


def columns(bars):
    return [type(column).__name__ for column in bars.columns]


def test_all_bars_have_the_same_columns(console):
    training = TrainingDisplay(done=0, steps=4, batch=1)
    bars = [each._bars for each in (RunDisplay(console), StudyDisplay(console), training)]
    looks = [columns(each) for each in (*bars, work_bar("looking", "drives"))]
    assert all(look == looks[0] for look in looks)
    assert {"TimeElapsedColumn", "TimeRemainingColumn"} < set(looks[0])
    percent = columns(work_bar("driving", "%"))
    assert set(percent) - set(looks[0]) == {"TaskProgressColumn"}


def test_a_bar_says_what_is_done_how_much_and_of_what(console):
    with work_bar("looking", "drives", console=console) as bars:
        bars.add_task("the third", total=4, completed=3)
    assert "looking" in shown(console)
    assert "3/4 drives" in shown(console)
    assert "the third" in shown(console)


def test_where_nothing_is_compiled_no_bar_comes_up(console):
    with RunDisplay(console) as display:
        display.compiling(Compiling())
        display.plan(2, 0)
    assert "compiling" not in shown(console)
    assert "0/2" in shown(console)


def test_the_first_kernel_brings_the_bar_up_and_the_last_one_fills_it(console):
    bars = work_bar(EACH, console=console)
    bar = CompileBar(bars)
    bar.fill()
    assert not bars.live.is_started
    for done in range(3):
        bar.show(Compiling(kernel=f"kernel_{done}", done=done, total=9))
    bar.show(Compiling())
    bars.stop()
    assert shown(console).count(COMPILING) == 1
    assert "9/9" in shown(console)
    assert "done" in shown(console)


def test_a_run_tells_of_what_failed_and_counts_what_is_done(console):
    with RunDisplay(console) as display:
        display.plan(3, 1)
        display.started(JOB)
        display.again(JOB, "Failed - Worker died", "killed")
        display.started(JOB)
        display.finished(route(status=AGENT_CRASHED, reason="KeyError"))
    lines = shown(console)
    assert "1 of 3 routes were driven before and are kept" in lines
    assert "route 7, seed 0: Failed - Worker died, tried again: killed" in lines
    assert f"route 7, seed 0: {AGENT_CRASHED}: KeyError" in lines
    assert "2/3" in lines
