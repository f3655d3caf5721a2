"""Figures of seeing, counted by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from agents.driveinsight.heads import ObjectClass
from agents.driveinsight.perception_losses import IGNORED, PerceptionTargets
from agents.driveinsight.semantics import BevClass
from agents.networks.grid import GridConfig
from agents.training.perception_metrics import _object_sums, _overlaps, _signal_sums, figures
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


def test_overlaps_leave_out_what_is_ignored_and_are_told_for_near_cells_too():
    grid = GridConfig(x_min_m=-8.0, x_max_m=56.0, y_min_m=-32.0, y_max_m=32.0, cells=64)  # of 1 m
    semantics = torch.zeros(1, 64, 64, dtype=torch.uint8)
    semantics[0, 20, 30:34] = int(BevClass.VEHICLE)  # 12.5 m ahead
    semantics[0, 60, 30:34] = int(BevClass.VEHICLE)  # 52.5 m ahead
    semantics[0, 21, 30] = IGNORED
    said = torch.zeros(1, len(BevClass), 64, 64)
    said[0, int(BevClass.VEHICLE), 20:22, 30:32] = 9.0  # 2 are right, 1 wrong, 1 not asked
    heads = SimpleNamespace(semantics=said)
    targets = PerceptionTargets(
        semantics=semantics, objects=torch.zeros(1, 0, 9), signal=torch.zeros(1, 8), lamps=None
    )
    found = figures(_overlaps(heads, targets, grid))
    assert found["iou_vehicle_near"] == pytest.approx(2 / 5)
    assert found["iou_vehicle"] == pytest.approx(2 / 9)
