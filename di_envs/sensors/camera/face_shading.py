"""How boxes and the sky look, a span of one row of pixels of one face at a time."""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.arrays import Float32, UInt8
from di_envs.numerics.kernels import kernel
from di_envs.sensors.camera.canvas import Canvas, Studio
from di_envs.sensors.camera.ground_shading import colour_by_raster
from di_envs.sensors.camera.spans import (
    Axis,
    blend,
    fill,
    flat,
    haze_span,
    mottle,
    multiply,
    windows,
)
from di_envs.sensors.scene.boxes import Material
from di_envs.sensors.weather import Look

_WINDOWS, _DECK = int(Material.WINDOWS), int(Material.DECK)
_FOLIAGE, _LAMP = int(Material.FOLIAGE), int(Material.LAMP)
F = np.float32


@kernel
def colour_sky(canvas: Canvas, look: Look, a: int, b: int, drop: float) -> None:
    """Colours the pixels [a, b) of a row of sky, whose rays rise by `drop`, 1 ahead."""
    up = max(0.0, drop) / math.sqrt(1.0 + drop * drop)
    k = 1.4 * up / (0.4 + up)
    for q in range(3):
        channel = canvas.red if q == 0 else (canvas.green if q == 1 else canvas.blue)
        fill(channel[a:b], F(255.0 * (look.horizon[q] + (look.zenith[q] - look.horizon[q]) * k)))


@kernel
def colour_face(
    studio: Studio, canvas: Canvas, code: int, a: int, b: int, y: int, tag: UInt8
) -> None:
    """Colours the pixels [a, b) of row y, all of one face.

    Args:
        studio: All that the picture is made from.
        canvas: Painted on; its depths are known.
        code: 6 times the number of the box among those seen, and the face.
        a, b, y: The pixels.
        tag: (W,) the row's tags: those of a deck are written, if the canvas has tags.
    """
    seen, look = studio.seen, studio.look
    source = seen.source[code // 6]
    depth = canvas.depth[y, a:b]
    material = studio.boxes.material[source]
    face = code % 6
    haze = F(look.haze)
    if material == _LAMP:
        haze = F(0.25) * haze
    red, green, blue = canvas.red[a:b], canvas.green[a:b], canvas.blue[a:b]
    if material == _DECK and face == 4:
        _deck(studio, canvas, code, a, b, y, tag)
        return
    sky_r, sky_g, sky_b = (
        F(255.0 * look.horizon[0]),
        F(255.0 * look.horizon[1]),
        F(255.0 * look.horizon[2]),
    )
    colour = seen.faces[code]
    flat(red, depth, haze, colour[0], sky_r)
    flat(green, depth, haze, colour[1], sky_g)
    flat(blue, depth, haze, colour[2], sky_b)
    if material != _WINDOWS and material != _FOLIAGE:
        return
    rays = seen.rays[code // 6]
    row, first, pixel = F(y), F(a), F(1.0 / canvas.cam.focal_px)
    pattern = canvas.u[a:b]
    side = 1 if face < 2 else 0
    along, up = _axis(rays, side, row), _axis(rays, 2, row)
    if material == _WINDOWS and face < 4:
        windows(pattern, depth, first, along, up, pixel)
        glow = F(255.0 * look.window_glow)
        blend(red, pattern, F(0.13) * sky_r + F(12.0) + F(0.62) * glow)
        blend(green, pattern, F(0.15) * sky_g + F(14.0) + F(0.48) * glow)
        blend(blue, pattern, F(0.18) * sky_b + F(18.0) + F(0.25) * glow)
    elif material == _FOLIAGE:
        mottle(pattern, depth, first, along, up, _axis(rays, 1 - side, row), pixel)
        multiply(red, pattern)
        multiply(green, pattern)
        multiply(blue, pattern)


@kernel
def _axis(rays: Float32, axis: int, row: F) -> Axis:
    """Where the rays of a row of pixels end along one axis of a box; see `Projected.rays`."""
    return Axis(rays[0, axis], rays[1, axis] + row * rays[3, axis], rays[2, axis])


@kernel
def _deck(studio: Studio, canvas: Canvas, code: int, a: int, b: int, y: int, tag: UInt8) -> None:
    """Colours the top of a deck by the raster of what is elevated; arguments of `colour_face`."""
    seen, look = studio.seen, studio.look
    over = seen.rays[code // 6, 0, 2] - studio.boxes.half[seen.source[code // 6], 2]
    colour_by_raster(canvas, studio.scene.deck, a, b, y, max(0.2, np.float64(over)), 0.0, tag)
    wet = 1.0 - 0.38 * look.wetness
    depth = canvas.depth[y, a:b]
    for q in range(3):
        channel = canvas.red if q == 0 else (canvas.green if q == 1 else canvas.blue)
        light = wet * (look.ambient[q] + look.sun_colour[q] * look.sun[2])
        haze_span(channel[a:b], depth, F(look.haze), F(light), F(255.0 * look.horizon[q]))
