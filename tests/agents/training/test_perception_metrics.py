"""Figures of seeing, counted by hand."""

from __future__ import annotations

import numpy as np
import pytest

from agents.driveinsight.heads import ObjectClass
from agents.training.perception_metrics import _object_sums, _signal_sums, figures
from di_envs.world.kinds import ActorKind

CARS = (ObjectClass.VEHICLE, ObjectClass.BICYCLE)


def car(x, y=0.0, *, vx=0.0, score=1.0, kind=ActorKind.CAR):
    return [x, y, 0.0, 4.0, 2.0, vx, 0.0, float(kind), score]


def rows(*found):
    return np.array(found, np.float32).reshape(-1, 9)


def test_who_is_near_a_row_is_found_once_and_a_second_row_is_a_false_alarm():
    true = rows(car(10.0, vx=5.0), car(20.0), car(40.0))
    said = rows(car(11.0, vx=7.0, score=0.9), car(10.5, score=0.8), car(39.0, score=0.7))
    sums = _object_sums("vehicles", CARS, 30.0, said, true)
    # the second row has nobody left within 2 m; the third is right, but beyond 30 m
    assert (sums["vehicles_hit"], sums["vehicles_said"], sums["vehicles_true"]) == (1, 2, 2)
    assert figures(sums)["speed_error_mps"] == pytest.approx(2.0)
    assert figures(sums)["place_error_m"] == pytest.approx(1.0)


def test_a_row_of_somebody_hidden_is_no_false_alarm_and_he_is_not_missed():
    hidden = rows(car(10.0, score=0.0))
    said = rows(car(10.5, score=0.9))
    sums = _object_sums("vehicles", CARS, 30.0, said, hidden)
    assert (sums["vehicles_hit"], sums["vehicles_said"], sums["vehicles_true"]) == (0, 0, 0)
    assert figures(sums)["vehicles_found"] is None


def test_unsure_rows_and_other_classes_do_not_count():
    true = rows(car(10.0), car(12.0, kind=ActorKind.WALKER))
    said = rows(car(10.0, score=0.2))
    sums = _object_sums("vehicles", CARS, 30.0, said, true)
    assert (sums["vehicles_hit"], sums["vehicles_said"], sums["vehicles_true"]) == (0, 0, 1)


def signal(x, *, red=0.0, green=0.0, stop=0.0, presence=1.0):
    return np.array([x, 0.0, 0.0, red, 0.0, green, stop, presence], np.float32)


def test_a_light_is_read_right_where_it_was_found_and_its_state_is_the_likeliest():
    true = signal(20.0, red=1.0)
    right = _signal_sums(signal(21.0, red=0.6, green=0.4), true)
    assert (right["state_asked"], right["state_hit"]) == (1, 1)
    assert figures(right)["line_error_m"] == pytest.approx(1.0)
    assert _signal_sums(signal(21.0, red=0.4, green=0.6), true)["state_hit"] == 0
    assert _signal_sums(signal(21.0, red=1.0, presence=0.4), true)["state_hit"] == 0


def test_signals_are_asked_for_up_to_their_range_and_signs_have_no_state():
    assert _signal_sums(signal(26.0, presence=0.0), signal(25.5, red=1.0)) == {}
    assert "state_asked" not in _signal_sums(signal(20.0, stop=1.0), signal(20.0, stop=1.0))
    alarm = _signal_sums(signal(20.0, red=1.0), np.zeros(8, np.float32))
    assert (alarm["signal_said"], alarm["signal_true"], alarm["signal_hit"]) == (1, 0, 0)
