"""The innermost loops of cameras against the plain way of doing the same."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from di_envs.sensors.camera.raster_spans import add_colours, fetch, texel_places, water_depths
from di_envs.sensors.camera.spans import BoxRays, hit_box, hit_upright, run_end

F = np.float32


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.tuples(st.integers(-1, 2), st.integers(1, 40)), min_size=1, max_size=6))
def test_a_run_ends_where_the_code_changes(runs):
    code = np.concatenate([np.full(length, value, np.int32) for value, length in runs])
    for start in range(code.size):
        other = np.flatnonzero(code[start:] != code[start])
        assert run_end(code, start, code.size) == (start + other[0] if other.size else code.size)


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.floats(-4.0, 4.0, width=32), min_size=9, max_size=9))
def test_an_upright_box_is_hit_as_any_box_is_to_the_last_bit(numbers):
    rx, ry, rz, ax, ay, dz, bx, by, size = (F(number) for number in numbers)
    half = abs(size) + F(0.1)
    seen = []
    for upright in (False, True):
        depth, code = np.full(70, 1000.0, F), np.full(70, -1, np.int32)
        start, box = F(3.0), np.int32(12)
        level = F(0.0)  # what a column adds to the rise of a ray
        rays = BoxRays(rx, ry, rz, ax, ay, dz, bx, by, level, half, half, half)
        if upright:
            hit_upright(depth, code, start, box, rays)
        else:
            hit_box(depth, code, start, box, rays)
        seen.append((depth.tobytes(), code.tobytes()))
    assert seen[0] == seen[1]


def raster(texels):
    """One level of 8 x 4 texels, in a row."""
    return np.array(texels, np.uint32).ravel(), 0, 8, 4


def looked_up(texels, u, v):
    texels, start, width, height = raster(texels)
    u, v = np.array(u, F), np.array(v, F)
    first, share = np.zeros(u.size, np.int32), np.zeros(u.size, np.int32)
    found = np.zeros(4 * u.size, np.uint32)
    texel_places(u, v, first, share, width, height, F(1.0))
    fetch(first, found, texels, start, width)
    return found, share


def test_a_sample_halfway_between_two_texels_is_their_mean():
    texels = np.zeros((4, 8), np.uint32)
    texels[1, 2], texels[1, 3] = 200 | 100 << 8 | 40 << 16, 100 | 50 << 8 | 80 << 16
    found, share = looked_up(texels, [2.5, 3.0, 3.5], [1.5, 1.5, 1.5])
    red, green, blue = np.zeros(3, F), np.zeros(3, F), np.zeros(3, F)
    add_colours(found, share, red, green, blue, F(1.0))
    assert red.tolist() == [200.0, 150.0, 100.0]
    assert green.tolist() == [100.0, 75.0, 50.0]
    assert blue.tolist() == [40.0, 60.0, 80.0]


@pytest.mark.parametrize(("tag", "deep"), [(1, 2.0), (24, 2.0), (10, 0.0)])
def test_water_stands_on_roads_and_lines_and_not_on_grass(tag, deep):
    """A place of lowness 1 is 2 below a level of 3; no more than 2 is counted of a level of 8."""
    texels = np.full((4, 8), (tag | 1 << 5) << 24, np.uint32)
    found, share = looked_up(texels, [2.5], [1.5])
    for level in (3.0, 8.0):
        water = np.zeros(1, F)
        water_depths(found, share, water, F(level))
        assert water.tolist() == [deep]
    dry = np.zeros(1, F)
    water_depths(found, share, dry, F(1.0))
    assert dry.tolist() == [0.0]
