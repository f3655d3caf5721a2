"""How boxes and the sky look, a span of one row of pixels of one face at a time."""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.arrays import Float32, UInt8
from di_envs.numerics.kernels import kernel
from di_envs.sensors.camera.canvas import Canvas, Studio
from di_envs.sensors.camera.ground_shading import colour_by_raster
from di_envs.sensors.camera.spans import (
    RGB,
    Axis,
    blend,
    fill,
    flat,
    haze_span,
    mottle,
    multiply,
    whole,
    windows,
)
from di_envs.sensors.scene.boxes import Material
from di_envs.sensors.weather import WeatherLook

_WINDOWS, _DECK = int(Material.WINDOWS), int(Material.DECK)
_FOLIAGE, _LAMP = int(Material.FOLIAGE), int(Material.LAMP)
F = np.float32


@kernel
def colour_sky(canvas: Canvas, look: WeatherLook, a: int, b: int, drop: float) -> None:
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
        tag: (W,) the row's tags: those of a deck are written; (0,) where they are not asked for.
    """
    seen, look = studio.seen, studio.look
    source = seen.source[code // 6]
    material = studio.boxes.material[source]
    face = code % 6
    haze = F(look.haze)
    if material == _LAMP:
        haze = F(0.25) * haze
    if material == _DECK and face == 4:
        _deck(studio, canvas, code, a, b, y, tag)
        return
    end = a + whole(b - a)
    red, green, blue = canvas.red[a:end], canvas.green[a:end], canvas.blue[a:end]
    depth = canvas.near[a:end]
    sky = _horizon(look)
    colour = seen.faces[code]
    flat(red, green, blue, depth, haze, (colour[0], colour[1], colour[2]), sky)
    if material != _WINDOWS and material != _FOLIAGE:
        return
    rays = seen.rays[code // 6]
    row, first, pixel = F(y), F(a), F(1.0 / canvas.cam.focal_px)
    pattern = canvas.pattern[a:end]
    side = 1 if face < 2 else 0
    along, up = _axis(rays, side, row), _axis(rays, 2, row)
    if material == _WINDOWS and face < 4:
        windows(pattern, depth, first, along, up, pixel)
        glow = F(255.0 * look.window_glow)
        pane = (
            F(0.13) * sky[0] + F(12.0) + F(0.62) * glow,
            F(0.15) * sky[1] + F(14.0) + F(0.48) * glow,
            F(0.18) * sky[2] + F(18.0) + F(0.25) * glow,
        )
        blend(red, green, blue, pattern, pane)
    elif material == _FOLIAGE:
        mottle(pattern, depth, first, along, up, _axis(rays, 1 - side, row), pixel)
        multiply(red, green, blue, pattern)


@kernel
def _horizon(look: WeatherLook) -> RGB:
    """The colour of the sky at the horizon, in levels."""
    return (
        F(255.0 * look.horizon[0]),
        F(255.0 * look.horizon[1]),
        F(255.0 * look.horizon[2]),
    )


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
    light = (
        F(wet * (look.ambient[0] + look.sun_colour[0] * look.sun[2])),
        F(wet * (look.ambient[1] + look.sun_colour[1] * look.sun[2])),
        F(wet * (look.ambient[2] + look.sun_colour[2] * look.sun[2])),
    )
    end = a + whole(b - a)
    red, green, blue = canvas.red[a:end], canvas.green[a:end], canvas.blue[a:end]
    haze_span(red, green, blue, canvas.near[a:end], F(look.haze), light, _horizon(look))
