"""Keyed draws: uniform, independent of each other, and functions of their keys alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from di_envs.numerics.keyed_random import Stream, keyed_hash, mix, normal, uniform

KEYS = st.integers(0, 2**31 - 1)
N = 20000


def draws(change: int, seed: int = 1, draw=uniform) -> np.ndarray:
    """N draws in which one of the four keys counts up, the others stay."""
    keys = [seed, int(Stream.TRAFFIC_TURN), 7, 3]
    out = np.empty(N)
    for k in range(N):
        out[k] = draw(*keys[:change], keys[change] + k, *keys[change + 1 :])
    return out


def test_the_mixing_is_that_of_splitmix64():
    """First outputs for seeds 0 and 1234567, as published with the reference implementation."""
    assert int(mix(np.uint64(0))) == 0xE220A8397B1DCDAF
    assert int(mix(np.uint64(1234567))) == 6457827717110365317


@pytest.mark.parametrize("change", range(4))
def test_whichever_key_counts_up_the_draws_are_uniform(change):
    """Chi square over 20 bins, 19 degrees of freedom: above 43.8 once in a thousand."""
    values = draws(change)
    assert values.min() >= 0.0
    assert values.max() < 1.0
    counts = np.bincount((values * 20).astype(int), minlength=20)
    assert ((counts - N / 20) ** 2 / (N / 20)).sum() < 43.8


@pytest.mark.parametrize("change", range(4))
def test_neighbouring_keys_give_draws_that_know_nothing_of_each_other(change):
    """A correlation of N independent pairs has a standard deviation of 1 / sqrt(N)."""
    values = draws(change)
    for lag in (1, 2, 10):
        correlation = np.corrcoef(values[:-lag], values[lag:])[0, 1]
        assert abs(correlation) < 4.0 / np.sqrt(N)


def test_streams_actors_and_seeds_are_not_shifted_copies_of_each_other():
    a = {keyed_hash(0, 3, tick, actor) for tick in range(50) for actor in range(50)}
    b = {keyed_hash(0, 4, tick, actor) for tick in range(50) for actor in range(50)}
    c = {keyed_hash(1, 3, tick, actor) for tick in range(50) for actor in range(50)}
    assert len(a | b | c) == 3 * 2500


def test_normal_draws_have_mean_zero_and_variance_one_and_normal_tails():
    values = draws(2, draw=normal)
    assert abs(values.mean()) < 4.0 / np.sqrt(N)
    assert abs(values.var() - 1.0) < 4.0 * np.sqrt(2.0 / N)
    assert np.mean(np.abs(values) < 1.0) == pytest.approx(0.6827, abs=0.014)
    assert np.mean(np.abs(values) < 2.0) == pytest.approx(0.9545, abs=0.006)
    assert np.isfinite(values).all()


@given(seed=KEYS, stream=st.sampled_from(Stream), tick=KEYS, actor=KEYS)
def test_a_draw_depends_on_its_keys_alone_and_on_each(seed, stream, tick, actor):
    value = keyed_hash(seed, int(stream), tick, actor)
    assert keyed_hash(seed, int(stream), tick, actor) == value
    others = [(seed + 1, stream, tick, actor), (seed, stream + 1, tick, actor)]
    others += [(seed, stream, tick + 1, actor), (seed, stream, tick, actor + 1)]
    assert value not in [keyed_hash(*map(int, keys)) for keys in others]


def test_numbers_of_streams_are_part_of_every_seed_and_stay():
    assert {stream.name: int(stream) for stream in Stream} == {
        "TRAFFIC_SPAWN": 1,
        "TRAFFIC_DRIVER": 2,
        "TRAFFIC_TURN": 3,
        "WALKER_SPAWN": 4,
        "WALKER_PACE": 5,
        "WALKER_TURN": 6,
        "LIGHT_PHASE": 7,
        "IMU": 8,
        "GNSS": 9,
        "AGENT": 10,
        "WEATHER": 11,
        "ROUTE": 12,
        "VEHICLE_COLOUR": 13,
        "SCENERY": 14,
        "RAIN": 15,
        "LIDAR": 16,
        "LIDAR_NOISE": 17,
        "SCENARIO": 18,
        "STEER_NOISE": 19,
        "THROTTLE_NOISE": 20,
        "TRAFFIC_RETURN": 21,
        "RADAR": 22,
    }
