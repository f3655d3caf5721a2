"""How the ground looks, a span of one row of pixels at a time: its raster, shadows, wet and haze.

Without roll a row of the ground plane lies at one depth, so its texels lie on a line.
"""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.kernels import kernel
from di_envs.sensors.camera.raster_spans import (
    add_colours,
    fetch,
    last_bytes,
    plane_points,
    puddles,
    spread,
    tags_of,
    texel_places,
    water_depths,
)
from di_envs.sensors.camera.spans import fill, light_ground, shade_span
from di_envs.sensors.scene.surfaces import LEVELS, TEXEL_M

_TAPS = 3  # samples along the road for a row that is far longer than wide
F = np.float32


@kernel
def colour_ground(studio, canvas, a, b, y, far, drop, tag):
    """Colours the pixels [a, b) of a row, all of the ground plane."""
    water_level = math.floor(3.0 * studio.look.numbers[3] + 1.0)
    if studio.look.numbers[3] <= 0.0:
        water_level = 0.0
    over = canvas.cam[2] - studio.scene.base_z[0]
    colour_by_raster(canvas, studio.scene.ground, a, b, y, over, water_level, tag)
    _light_plane(canvas, studio.look, a, b, far, drop)


@kernel
def colour_by_raster(canvas, raster, a, b, y, over, water_level, tag):
    """Colours a span by a raster that lies level, and tags it where that is asked for.

    Where a texel is wider than some pixels, only every second, fourth or eighth is sampled and
    those between are filled in. Where a pixel is longer than wide, several samples are taken.

    Args:
        canvas: `Canvas`; its depths are known.
        raster: `Raster`.
        a, b, y: The pixels [a, b) of row y.
        over: How far below the camera the raster lies [m].
        water_level: Up to where there are puddles, 0 for none; their depths go to `canvas.water`.
        tag: (W,) the row's tags, written if the canvas has tags.
    """
    cam = canvas.cam
    focal = cam[12]
    v = (y + 0.5 - cam[14]) / focal
    depth = canvas.depth[y, a:b]
    middle = np.float64(depth[(b - a) // 2])
    gx, gy = cam[3] + v * cam[9], cam[4] + v * cam[10]
    flat_m = math.hypot(gx, gy)
    wide = middle / focal
    long = wide * max(1.0, middle * flat_m / over)
    taps = int(min(max(math.floor(long / wide * 0.5), 1.0), _TAPS * 1.0))
    level = _level(max(wide, long / taps))
    stride = 1
    while stride < 8 and wide * stride * 3.0 <= TEXEL_M * (1 << level):
        stride *= 2
    n = b - a if stride == 1 else (b - a - 1) // stride + 2
    u, w, index, share = canvas.u[:n], canvas.v[:n], canvas.texel[:n], canvas.share[:n]
    red, green, blue = canvas.samples[0, :n], canvas.samples[1, :n], canvas.samples[2, :n]
    water = canvas.samples[3, :n]
    if stride == 1:
        red, green, blue = canvas.red[a:b], canvas.green[a:b], canvas.blue[a:b]
        water = canvas.water[a:b]
    fill(red, F(0.0))
    fill(green, F(0.0))
    fill(blue, F(0.0))
    u0 = (0.5 - cam[13]) / focal
    x0, y0 = cam[0] - raster.origin[0], cam[1] - raster.origin[1]
    start, width, height = raster.start[level], raster.width[level], raster.height[level]
    for tap in range(taps):
        shift = ((tap + 0.5) / taps - 0.5) * long / flat_m
        _places(canvas, u, depth, stride, (x0 + shift * gx, gx + u0 * cam[6], cam[6]), a)
        _places(canvas, w, depth, stride, (y0 + shift * gy, gy + u0 * cam[7], cam[7]), a)
        texel_places(u, w, index, share, width, height, F(1.0 / (1 << level)))
        fetch(index, canvas.found, raster.texels, start, width)
        add_colours(canvas.found, share, red, green, blue, F(1.0 / taps))
        if water_level > 0.0 and tap == taps // 2:
            water_depths(canvas.found, share, water, F(water_level))
    if stride > 1:
        spread(red, canvas.red[a:b], stride)
        spread(green, canvas.green[a:b], stride)
        spread(blue, canvas.blue[a:b], stride)
        if water_level > 0.0:
            spread(water, canvas.water[a:b], stride)
    if canvas.tag.shape[0] > 0:
        u, w = canvas.u[: b - a], canvas.v[: b - a]
        _places(canvas, u, depth, 1, (x0, gx + u0 * cam[6], cam[6]), a)
        _places(canvas, w, depth, 1, (y0, gy + u0 * cam[7], cam[7]), a)
        last_bytes(u, w, canvas.last[a:b], raster.texels, raster.width[0], raster.height[0])
        tags_of(canvas.last[a:b], tag[a:b])


@kernel
def _places(canvas, out, depth, stride, terms, a):
    """Writes places along one axis, in texels: terms are of the camera, of depth, of columns."""
    start, gain, turn = terms
    turn = turn / canvas.cam[12]
    plane_points(out, depth, stride, F(start / TEXEL_M), F(gain / TEXEL_M), F(turn / TEXEL_M), F(a))


@kernel
def _level(footprint_m):
    """Level of a raster whose texels are about as large as a footprint."""
    level = math.floor(math.log2(max(footprint_m / TEXEL_M, 1e-3)) + 0.6)
    return min(max(level, 0), LEVELS - 1)


@kernel
def shade_row(studio, canvas, v, far):
    """Marks which pixels of a row of ground lie in shadow."""
    cam, seen = canvas.cam, studio.seen
    fill(canvas.shadow, F(0.0))
    width = canvas.shadow.shape[0]
    focal = cam[12]
    u0 = (0.5 - cam[13]) / focal
    x0 = far * (cam[3] + u0 * cam[6] + v * cam[9])
    y0 = far * (cam[4] + u0 * cam[7] + v * cam[10])
    dx, dy = far * cam[6] / focal, far * cam[7] / focal
    flat_m = far * math.hypot(cam[3] + v * cam[9], cam[4] + v * cam[10])
    above = max(0.1, cam[2] - studio.scene.base_z[0])
    long = far / focal * max(1.0, flat_m / above)  # of a pixel, along the road
    for k in range(seen.count[1]):
        row = seen.shadow[k]
        if flat_m < row[12] or flat_m > row[13]:
            continue
        start, end = -0.5, width - 0.5
        for strip in range(3):
            at = row[4 * strip] * x0 + row[4 * strip + 1] * y0
            step = row[4 * strip] * dx + row[4 * strip + 1] * dy
            if abs(step) < 1e-9:
                if at < row[4 * strip + 2] or at > row[4 * strip + 3]:
                    end = -1e9
                continue
            over = 1.0 / step
            a, b = (row[4 * strip + 2] - at) * over, (row[4 * strip + 3] - at) * over
            start, end = max(start, min(a, b)), min(end, max(a, b))
            if end <= start:
                break
        if end > start:
            first = max(0, math.floor(start))
            stop = min(width, math.ceil(end) + 1)
            shade_span(
                canvas.shadow[first:stop], F(first), F(start), F(end), F(min(1.0, row[14] / long))
            )


@kernel
def _light_plane(canvas, look, a, b, far, drop):
    """Lights a span of ground, wets it, and hides it in haze."""
    numbers = look.numbers
    k = numbers[0] * far
    clear = 1.0 / (1.0 + k + 0.5 * k * k)
    steep = min(1.0, -drop)
    graze = (1.0 - steep) ** 3
    mirror = numbers[2] * 0.5 * graze
    dim = (1.0 - 0.38 * numbers[2]) * (1.0 - mirror) * clear
    for q in range(3):
        sun = look.sun_colour[q] * look.sun[2]
        lit = dim * (look.ambient[q] + sun)
        dark = dim * (0.70 * look.ambient[q] + sun * (1.0 - numbers[1]))
        sky = 255.0 * (look.horizon[q] * (1.0 - steep) + look.zenith[q] * steep)
        add = 255.0 * look.horizon[q] * (1.0 - clear) + sky * mirror * clear
        channel = canvas.red if q == 0 else (canvas.green if q == 1 else canvas.blue)
        light_ground(channel[a:b], canvas.shadow[a:b], F(lit), F(dark), F(add))
    if numbers[3] > 0.0:
        share = F((0.25 + 0.6 * graze) * clear)
        puddles(
            canvas.water[a:b], canvas.red[a:b], canvas.green[a:b], canvas.blue[a:b], share,
            F(235.0 * look.horizon[0]), F(235.0 * look.horizon[1]), F(235.0 * look.horizon[2]),
        )  # fmt: skip
