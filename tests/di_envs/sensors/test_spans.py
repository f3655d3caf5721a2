"""The innermost loops of cameras against the plain way of doing the same."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from di_envs.sensors.camera.raster_spans import add_colours, fetch, texel_places, water_depths
from di_envs.sensors.camera.runs import mark_ends, run_end
from di_envs.sensors.camera.spans import (
    BLOCK,
    Axis,
    BoxRays,
    hit_box,
    hit_upright,
    whole,
)

F = np.float32


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.tuples(st.integers(-1, 2), st.integers(1, 40)), min_size=1, max_size=6))
def test_a_run_ends_where_the_code_changes(runs):
    code = np.concatenate([np.full(length, value, np.int32) for value, length in runs])
    room = whole(code.size)
    ends = np.full(room, 7, np.uint8)
    mark_ends(np.append(code, np.full(room, -1, np.int32)), ends)
    for start in range(code.size):
        other = np.flatnonzero(code[start:] != code[start])
        expected = start + other[0] if other.size else code.size
        assert run_end(ends, ends.view(np.uint64), start, code.size) == expected


@pytest.mark.parametrize(("pixels", "rounded"), [(0, 0), (1, 8), (8, 8), (9, 16)])
def test_spans_are_of_whole_blocks(pixels, rounded):
    assert BLOCK == 8
    assert whole(pixels) == rounded


@pytest.mark.parametrize("hit", [hit_upright, hit_box])
def test_nothing_is_hit_beyond_a_spans_end(hit):
    """A wall right across the row, of which only columns 2 to 12 may be covered."""
    rays = BoxRays(*map(F, (-5.0, 0.0, 0.0, 1.0, -0.5, 0.01, 0.0, 0.05, 0.0, 1.0, 9.0, 9.0)))
    depth, code = np.full(24, 1000.0, F), np.full(24, -1, np.int32)
    hit(depth[2:18], code[2:18], F(2.0), F(12.0), np.int32(6), rays)
    assert np.flatnonzero(code >= 0).tolist() == list(range(2, 12))
    assert depth[2:12].tolist() == [4.0] * 10


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.floats(-4.0, 4.0, width=32), min_size=9, max_size=9))
def test_an_upright_box_is_hit_as_any_box_is_to_the_last_bit(numbers):
    rx, ry, rz, ax, ay, dz, bx, by, size = (F(number) for number in numbers)
    half = abs(size) + F(0.1)
    seen = []
    for upright in (False, True):
        depth, code = np.full(72, 1000.0, F), np.full(72, -1, np.int32)
        start, end, box = F(3.0), F(73.0), np.int32(12)
        level = F(0.0)  # what a column adds to the rise of a ray
        rays = BoxRays(rx, ry, rz, ax, ay, dz, bx, by, level, half, half, half)
        if upright:
            hit_upright(depth, code, start, end, box, rays)
        else:
            hit_box(depth, code, start, end, box, rays)
        seen.append((depth.tobytes(), code.tobytes()))
    assert seen[0] == seen[1]


def raster(texels):
    """One level of 8 x 4 texels, in a row."""
    return np.array(texels, np.uint32).ravel(), 0, 8, 4


def looked_up(texels, u, step, v):
    """A block of places in a row, from (u, v) on, each `step` texels further than the last."""
    texels, start, width, height = raster(texels)
    depth = np.ones(BLOCK, F)
    first, share = np.zeros(BLOCK, np.int32), np.zeros(BLOCK, np.int32)
    found = np.zeros(4 * BLOCK, np.uint32)
    across, down = Axis(F(u), F(0.0), F(step)), Axis(F(v), F(0.0), F(0.0))
    texel_places(depth, 1, F(0.0), across, down, first, share, width, height, F(1.0))
    fetch(first, found, texels, start, width)
    return found, share


def test_a_sample_halfway_between_two_texels_is_their_mean():
    texels = np.zeros((4, 8), np.uint32)
    texels[1, 2], texels[1, 3] = 200 | 100 << 8 | 40 << 16, 100 | 50 << 8 | 80 << 16
    found, share = looked_up(texels, 2.5, 0.5, 1.5)
    red, green, blue = np.full((3, BLOCK), 7.0, F)
    for tap in range(2):  # the first writes, whatever was there
        add_colours(found, share, red, green, blue, F(0.5), tap > 0)
    assert red[:3].tolist() == [200.0, 150.0, 100.0]
    assert green[:3].tolist() == [100.0, 75.0, 50.0]
    assert blue[:3].tolist() == [40.0, 60.0, 80.0]


@pytest.mark.parametrize(("tag", "deep"), [(1, 2.0), (24, 2.0), (10, 0.0)])
def test_water_stands_on_roads_and_lines_and_not_on_grass(tag, deep):
    """A place of lowness 1 is 2 below a level of 3; no more than 2 is counted of a level of 8."""
    texels = np.full((4, 8), (tag | 1 << 5) << 24, np.uint32)
    found, share = looked_up(texels, 2.5, 0.0, 1.5)
    for level in (3.0, 8.0):
        water = np.zeros(BLOCK, F)
        water_depths(found, share, water, F(level))
        assert water.tolist() == [deep] * BLOCK
    dry = np.zeros(BLOCK, F)
    water_depths(found, share, dry, F(1.0))
    assert dry.tolist() == [0.0] * BLOCK
