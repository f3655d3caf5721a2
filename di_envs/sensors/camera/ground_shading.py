"""How the ground looks, a span of one row of pixels at a time: its raster, shadows, wet and haze.

Without roll a row of the ground plane lies at one depth, so its texels lie on a line.
"""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.arrays import Float64, UInt8
from di_envs.numerics.kernels import kernel
from di_envs.sensors.camera.canvas import Canvas, Studio
from di_envs.sensors.camera.config import STEEP_RAD
from di_envs.sensors.camera.raster_spans import (
    add_colours,
    every,
    fetch,
    puddles,
    spread,
    tags_at,
    texel_places,
    water_depths,
)
from di_envs.sensors.camera.spans import RGB, Axis, fill, light_ground, shade_span, whole
from di_envs.sensors.scene.raster import LEVELS, TEXEL_M, Raster
from di_envs.sensors.weather import WeatherLook

_TAPS = 3  # samples along the road for a row that is far longer than wide
F = np.float32


@kernel
def colour_ground(
    studio: Studio, canvas: Canvas, a: int, b: int, y: int, far: float, drop: float, tag: UInt8
) -> None:
    """Colours the pixels [a, b) of row y, all of the ground plane.

    Args:
        studio: All that the picture is made from.
        canvas: Painted on; its depths are known.
        a, b, y: The pixels.
        far: Their depth [m].
        drop: How the row's rays rise, 1 ahead.
        tag: (W,) the row's tags, written; (0,) where they are not asked for.
    """
    water_level = 0.0
    if studio.look.puddles > 0.0:
        water_level = math.floor(3.0 * studio.look.puddles + 1.0)
    over = canvas.cam.eye[2] - studio.scene.base_z[0]
    colour_by_raster(canvas, studio.scene.ground, a, b, y, over, water_level, tag)
    _light_plane(canvas, studio.look, a, b, far, drop)


@kernel
def colour_by_raster(
    canvas: Canvas,
    raster: Raster,
    a: int,
    b: int,
    y: int,
    over: float,
    water_level: float,
    tag: UInt8,
) -> None:
    """Colours a span by a raster that lies level, and tags it where that is asked for.

    Where a texel is wider than some pixels, only every second, fourth or eighth is sampled and
    those between are filled in. Where a pixel is longer than wide, several samples are taken.

    Args:
        canvas: Painted on; its depths are known.
        raster: What lies there.
        a, b, y: The pixels [a, b) of row y.
        over: How far below the camera the raster lies [m].
        water_level: Up to where there are puddles, 0 for none; their depths go to `canvas.water`.
        tag: (W,) the row's tags, written; (0,) where they are not asked for.
    """
    cam = canvas.cam
    focal = cam.focal_px
    v = (y + 0.5 - cam.cy_px) / focal
    depth = canvas.near[a:b]
    middle = np.float64(depth[(b - a) // 2])
    right = cam.right
    gx, gy = cam.ahead[0] + v * cam.down[0], cam.ahead[1] + v * cam.down[1]
    flat_m = math.hypot(gx, gy)
    wide = middle / focal
    long = wide * max(1.0, middle * flat_m / over)
    taps = int(min(max(math.floor(long / wide * 0.5), 1.0), _TAPS * 1.0))
    level = _level(max(wide, long / taps))
    stride = 1
    while stride < 8 and wide * stride * 3.0 <= TEXEL_M * (1 << level):
        stride *= 2
    end = a + whole(b - a)
    count = b - a if stride == 1 else (b - a - 1) // stride + 2
    n = end - a if stride == 1 else whole((end - a) // stride + 1)
    index, share = canvas.texel[:n], canvas.share[:n]
    if stride == 1:
        z = canvas.near[a:end]
        red, green, blue = canvas.red[a:end], canvas.green[a:end], canvas.blue[a:end]
        water = canvas.water[a:end]
    else:
        z = canvas.pattern[:n]
        every(depth, stride, count, z)
        red, green, blue = canvas.samples[0, :n], canvas.samples[1, :n], canvas.samples[2, :n]
        water = canvas.samples[3, :n]
    u0 = (0.5 - cam.cx_px) / focal
    x0, y0 = cam.eye[0] - raster.origin[0], cam.eye[1] - raster.origin[1]
    start, width, height = raster.start[level], raster.width[level], raster.height[level]
    for tap in range(taps):
        shift = ((tap + 0.5) / taps - 0.5) * long / max(flat_m, 1e-9)
        across = _axis(x0 + shift * gx, gx + u0 * right[0], right[0] / focal)
        down = _axis(y0 + shift * gy, gy + u0 * right[1], right[1] / focal)
        scale = F(1.0 / (1 << level))
        texel_places(z, stride, F(a), across, down, index, share, width, height, scale)
        fetch(index[:count], canvas.found, raster.texels, start, width)
        add_colours(canvas.found, share, red, green, blue, F(1.0 / taps), tap > 0)
        if water_level > 0.0 and tap == taps // 2:
            water_depths(canvas.found, share, water, F(water_level))
    if stride > 1:
        spread(red, canvas.red[a:end], stride)
        spread(green, canvas.green[a:end], stride)
        spread(blue, canvas.blue[a:end], stride)
        if water_level > 0.0:
            spread(water, canvas.water[a:end], stride)
    if tag.shape[0] > 0:
        across = _axis(x0, gx + u0 * right[0], right[0] / focal)
        down = _axis(y0, gy + u0 * right[1], right[1] / focal)
        width, height = raster.width[0], raster.height[0]
        tags_at(depth, F(a), across, down, tag[a:b], raster.texels, width, height)


@kernel
def _axis(start_m: float, gain_m: float, turn_m: float) -> Axis:
    """An axis of a raster in texels, from the same in metres."""
    return Axis(F(start_m / TEXEL_M), F(gain_m / TEXEL_M), F(turn_m / TEXEL_M))


@kernel
def _level(footprint_m: float) -> int:
    """Level of a raster whose texels are about as large as a footprint."""
    level = math.floor(math.log2(max(footprint_m / TEXEL_M, 1e-3)) + 0.6)
    return min(max(level, 0), LEVELS - 1)


@kernel
def shade_row(studio: Studio, canvas: Canvas, v: float, far: float) -> None:
    """Marks which pixels of a row of ground lie in shadow, in `canvas.shadow`.

    Args:
        studio: All that the picture is made from.
        canvas: Its shadow is written.
        v: How far down the row's rays go, 1 ahead.
        far: Depth of the ground [m].
    """
    cam, seen = canvas.cam, studio.seen
    fill(canvas.shadow, F(0.0))
    width = canvas.depth.shape[1]
    focal, ahead, right, down = cam.focal_px, cam.ahead, cam.right, cam.down
    u0 = (0.5 - cam.cx_px) / focal
    x0 = far * (ahead[0] + u0 * right[0] + v * down[0])
    y0 = far * (ahead[1] + u0 * right[1] + v * down[1])
    dx, dy = far * right[0] / focal, far * right[1] / focal
    flat_m = far * math.hypot(ahead[0] + v * down[0], ahead[1] + v * down[1])
    above = max(0.1, cam.eye[2] - studio.scene.base_z[0])
    long = far / focal * max(1.0, flat_m / above)  # of a pixel, along the road
    back = ahead[0] * (ahead[0] + v * down[0]) + ahead[1] * (ahead[1] + v * down[1]) < 0.0
    if back and abs(cam.pitch_rad) > STEEP_RAD:
        flat_m = -flat_m  # what lies behind the camera's foot
    for k in range(seen.count[1]):
        least_m, most_m, wide_m = seen.shadow_m[k, 0], seen.shadow_m[k, 1], seen.shadow_m[k, 2]
        if flat_m < least_m or flat_m > most_m:
            continue
        start, end = _within_strips(seen.strips[k], (x0, y0), (dx, dy), width)
        if end > start:
            first = max(0, math.floor(start))
            stop = first + whole(min(width, math.ceil(end) + 1) - first)
            shade_span(
                canvas.shadow[first:stop], F(first), F(start), F(end), F(min(1.0, wide_m / long))
            )


@kernel
def _within_strips(
    strips: Float64, place: tuple[float, float], step: tuple[float, float], width: int
) -> tuple[float, float]:
    """From where to where a row of pixels lies in all three strips of a shadow.

    Args:
        strips: (3, 4) as in `Projected.strips`.
        place: Where the middle of pixel 0 shows the plane, from the camera's place [m].
        step: From there to the next pixel's [m].
        width: Of the row [px].

    Returns:
        Columns of the beginning and the end, between pixels too. Where there is no shadow, the end
        is not beyond the beginning.
    """
    start, end = -0.5, width - 0.5
    for strip in range(3):
        nx, ny, least, most = strips[strip, 0], strips[strip, 1], strips[strip, 2], strips[strip, 3]
        at = nx * place[0] + ny * place[1]
        per_pixel = nx * step[0] + ny * step[1]
        if abs(per_pixel) < 1e-9:
            if at < least or at > most:
                end = -1e9
            continue
        over = 1.0 / per_pixel
        a, b = (least - at) * over, (most - at) * over
        start, end = max(start, min(a, b)), min(end, max(a, b))
        if end <= start:
            break
    return start, end


@kernel
def _light_plane(
    canvas: Canvas, look: WeatherLook, a: int, b: int, far: float, drop: float
) -> None:
    """Lights a span of ground, wets it, and hides it in haze; arguments of `colour_ground`."""
    k = look.haze * far
    clear = 1.0 / (1.0 + k + 0.5 * k * k)
    steep = min(1.0, -drop)
    graze = (1.0 - steep) ** 3
    mirror = look.wetness * 0.5 * graze
    dim = (1.0 - 0.38 * look.wetness) * (1.0 - mirror) * clear
    end = a + whole(b - a)
    red, green, blue = canvas.red[a:end], canvas.green[a:end], canvas.blue[a:end]
    of_r = _plane_light(look, 0, clear, steep, mirror, dim)
    of_g = _plane_light(look, 1, clear, steep, mirror, dim)
    of_b = _plane_light(look, 2, clear, steep, mirror, dim)
    lit = (of_r[0], of_g[0], of_b[0])
    dark = (of_r[1], of_g[1], of_b[1])
    add = (of_r[2], of_g[2], of_b[2])
    light_ground(red, green, blue, canvas.shadow[a:end], lit, dark, add)
    if look.puddles > 0.0:
        share = F((0.25 + 0.6 * graze) * clear)
        sky = (
            F(235.0 * look.horizon[0]),
            F(235.0 * look.horizon[1]),
            F(235.0 * look.horizon[2]),
        )
        puddles(canvas.water[a:end], red, green, blue, share, sky)


@kernel
def _plane_light(
    look: WeatherLook, channel: int, clear: float, steep: float, mirror: float, dim: float
) -> RGB:
    """By what a channel of ground is lit in the sun and in shadow, and what haze and wet add."""
    sun = look.sun_colour[channel] * look.sun[2]
    lit = dim * (look.ambient[channel] + sun)
    dark = dim * (0.70 * look.ambient[channel] + sun * (1.0 - look.shadow))
    sky = 255.0 * (look.horizon[channel] * (1.0 - steep) + look.zenith[channel] * steep)
    add = 255.0 * look.horizon[channel] * (1.0 - clear) + sky * mirror * clear
    return F(lit), F(dark), F(add)
