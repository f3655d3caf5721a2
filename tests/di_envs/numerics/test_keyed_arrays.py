"""Arrays of keyed draws are the kernels' draws, element by element."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from di_envs.numerics import keyed_random
from di_envs.numerics.keyed_arrays import keyed_hashes, keyed_normals, keyed_uniforms, stream_of

SEEDS = st.integers(0, 2**63 - 1)


@settings(deadline=None)  # the first call compiles
@given(seed=SEEDS, stream=st.integers(0, 2**40), tick=st.integers(0, 10**6))
def test_each_element_is_the_kernels_draw_of_its_number(seed, stream, tick):
    drawn = keyed_uniforms(seed, stream, tick, (2, 3))
    assert drawn.shape == (2, 3)
    for number, value in enumerate(drawn.ravel().tolist()):
        assert value == keyed_random.uniform(np.uint64(seed), np.uint64(stream), tick, number)


def test_normal_draws_are_the_kernels_to_rounding():
    drawn = keyed_normals(7, 30, 4, (50,))
    expected = [keyed_random.normal(7, 30, 4, number) for number in range(50)]
    np.testing.assert_allclose(drawn, expected, rtol=1e-12)


def test_many_worlds_draw_what_each_draws_alone_to_the_bit():
    seeds, ticks = np.array([3, 2**40, 5]), np.array([0, 9, 9])
    for draw in (keyed_uniforms, keyed_normals):
        together = draw(seeds, 99, ticks, (13,))
        for row, (seed, tick) in enumerate(zip(seeds, ticks, strict=True)):
            assert np.array_equal(together[row], draw(int(seed), 99, int(tick), (13,)))


def test_normal_draws_have_the_mean_and_spread_that_they_should():
    drawn = keyed_normals(1, 2, 3, (20_000,))
    assert drawn.mean() == pytest.approx(0.0, abs=4.0 / np.sqrt(20_000))
    assert drawn.std() == pytest.approx(1.0, abs=0.03)


def test_streams_of_different_texts_differ():
    assert stream_of("noise:map,sigma=0.5") != stream_of("noise:map,sigma=0.6")
    assert stream_of("mask") == stream_of("mask")


@pytest.mark.parametrize("seed", [0, 7, 2**63 + 5])
def test_hashes_of_many_actors_are_those_of_each(seed):
    found = keyed_hashes(seed, 3, 11, 20)
    assert found.dtype == np.uint64
    for actor, value in enumerate(found.tolist()):
        assert value == int(keyed_random.keyed_hash(np.uint64(seed), 3, 11, actor))
