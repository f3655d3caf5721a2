"""Eyes that err: whom they miss, who is not there, and what they are a little off in."""

from __future__ import annotations

import numpy as np
import pytest

from agents.networks.grid import WIDE_GRID
from agents.training.seen_noise import NO_NOISE, EyeConfig, seen_through


def truth(batch=400):
    """A car 30 m ahead at 10 m/s, a walker as far, and a red light, in each sample."""
    objects, signals = np.zeros((batch, 24, 9), np.float32), np.zeros((batch, 2, 8), np.float32)
    objects[:, 0] = [30.0, 0.0, 0.0, 4.5, 2.0, 10.0, 0.0, 1, 1]
    objects[:, 1] = [30.0, 3.0, 0.0, 0.5, 0.5, 1.0, 0.0, 7, 1]
    signals[:, 0] = [25.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    return objects, signals


def test_perfect_eyes_see_the_truth():
    objects, signals = truth()
    seen = seen_through(NO_NOISE, WIDE_GRID, objects, signals, key=1)
    assert np.array_equal(seen[0], objects)
    assert np.array_equal(seen[1], signals)


def test_eyes_miss_a_walker_more_often_than_a_car_as_far_away_and_see_ghosts_now_and_then():
    eyes = EyeConfig(perfect=0.0, missed_at_30_m=0.2, ghosts=0.5)
    objects, _ = seen_through(eyes, WIDE_GRID, *truth(), key=1)
    ahead = np.abs(objects[..., 0] - 30.0) < 3.0
    cars = ((objects[..., 7] == 1) & ahead & (objects[..., 5] > 5.0)).any(axis=1)
    walkers = ((objects[..., 7] == 7) & ahead).any(axis=1)
    assert cars.mean() == pytest.approx(0.8, abs=0.06)  # 0.2 times 0 to 2
    assert walkers.mean() < cars.mean() - 0.2
    assert (objects[..., 8] > 0.0).sum() > cars.sum() + walkers.sum()
    assert (np.diff(objects[..., 8], axis=1) <= 0.0).all()  # by falling score


def test_eyes_tell_a_light_by_probabilities_that_sum_to_one():
    _, signals = seen_through(EyeConfig(perfect=0.0), WIDE_GRID, *truth(), key=1)
    there = signals[..., 7] > 0.0
    assert signals[there][:, 3:7].sum(axis=1) == pytest.approx(np.ones(there.sum()), abs=1e-5)
    assert (signals[there][:, 3] > 0.5).mean() > 0.9
