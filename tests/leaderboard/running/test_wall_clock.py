"""Limits of wall-clock time, with the clock in the test's hand."""

from __future__ import annotations

import time

import pytest

from leaderboard.running.wall_clock import Doing, Limits, Stopwatch

LIMITS = Limits(step_s=10.0, setup_s=20.0, route_s=100.0)


@pytest.fixture
def clock(monkeypatch):
    now = [1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    return now


@pytest.mark.parametrize(
    ("doing", "limit_s", "name"),
    [
        (Doing.STEPPING, 10.0, "a step of the agent took more than 10 s"),
        (Doing.SETTING_UP, 20.0, "setting up the agent took more than 20 s"),
        (Doing.LOADING, 20.0, "loading the town and the kernels took more than 20 s"),
        (Doing.SIMULATING, 20.0, "a step of the simulation took more than 20 s"),
        (Doing.CLOSING, 20.0, "closing the agent took more than 20 s"),
    ],
)
def test_each_thing_has_its_limit(clock, doing, limit_s, name):
    watch = Stopwatch()
    watch.mark(doing)
    clock[0] += limit_s
    assert watch.overdue(LIMITS) == ""
    clock[0] += 0.001
    assert watch.overdue(LIMITS) == name


def test_a_new_step_or_a_lap_starts_anew(clock):
    watch = Stopwatch()
    for go_on in (lambda: watch.mark(Doing.STEPPING), watch.lap):
        go_on()
        clock[0] += 10.0
        assert watch.overdue(LIMITS) == ""


def test_a_route_of_quick_steps_has_a_limit_too(clock):
    watch = Stopwatch()
    watch.begin_job()
    for _ in range(11):
        assert watch.overdue(LIMITS) == ""
        clock[0] += 10.0
        watch.mark(Doing.STEPPING)
    assert watch.overdue(LIMITS) == "the route took more than 100 s of wall-clock time"
    watch.end_job()
    clock[0] += 1000.0
    assert watch.overdue(LIMITS) == ""  # who waits for work may wait


@pytest.mark.parametrize("name", ["step_s", "setup_s", "route_s"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_a_limit_is_positive(name, value):
    with pytest.raises(ValueError, match=f"{name} must be positive"):
        Limits(**{name: value})
