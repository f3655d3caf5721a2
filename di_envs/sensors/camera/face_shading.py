"""How boxes and the sky look, a span of one row of pixels of one face at a time."""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.kernels import kernel
from di_envs.sensors.camera.ground_shading import colour_by_raster
from di_envs.sensors.camera.spans import (
    blend,
    fill,
    flat,
    haze_span,
    mottle,
    multiply,
    windows,
)
from di_envs.sensors.scene.boxes import Material

_WINDOWS, _DECK = int(Material.WINDOWS), int(Material.DECK)
_FOLIAGE, _LAMP = int(Material.FOLIAGE), int(Material.LAMP)
F = np.float32


@kernel
def colour_sky(canvas, look, a, b, drop):
    """Colours a span of sky, by how far above the horizon it is."""
    up = max(0.0, drop) / math.sqrt(1.0 + drop * drop)
    k = 1.4 * up / (0.4 + up)
    for q in range(3):
        channel = canvas.red if q == 0 else (canvas.green if q == 1 else canvas.blue)
        fill(channel[a:b], F(255.0 * (look.horizon[q] + (look.zenith[q] - look.horizon[q]) * k)))


@kernel
def colour_face(studio, canvas, code, a, b, y, tag):
    """Colours the pixels [a, b) of a row, all of one face."""
    seen, look, cam = studio.seen, studio.look, canvas.cam
    source = seen.source[code // 6]
    depth = canvas.depth[y, a:b]
    material = studio.boxes.material[source]
    face = code % 6
    haze = F(look.numbers[0])
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
    ray = seen.ray[code // 6]
    row, first, pixel = F(y), F(a), F(1.0 / cam[12])
    pattern = canvas.u[a:b]
    side = 1 if face < 2 else 0
    qa, pa = ray[3 + side] + row * ray[9 + side], ray[5] + row * ray[11]
    if material == _WINDOWS and face < 4:
        windows(pattern, depth, first, ray[side], qa, ray[6 + side], ray[2], pa, ray[8], pixel)
        glow = F(255.0 * look.numbers[7])
        blend(red, pattern, F(0.13) * sky_r + F(12.0) + F(0.62) * glow)
        blend(green, pattern, F(0.15) * sky_g + F(14.0) + F(0.48) * glow)
        blend(blue, pattern, F(0.18) * sky_b + F(18.0) + F(0.25) * glow)
    elif material == _FOLIAGE:
        other = 1 - side
        sa = ray[3 + other] + row * ray[9 + other]
        mottle(
            pattern, depth, first, ray[side], qa, ray[6 + side], ray[2], pa, ray[8],
            ray[other], sa, ray[6 + other], pixel,
        )  # fmt: skip
        multiply(red, pattern)
        multiply(green, pattern)
        multiply(blue, pattern)


@kernel
def _deck(studio, canvas, code, a, b, y, tag):
    """Colours the top of a deck by the raster of what is elevated."""
    seen, look = studio.seen, studio.look
    over = seen.ray[code // 6, 2] - studio.boxes.half[seen.source[code // 6], 2]
    colour_by_raster(canvas, studio.scene.deck, a, b, y, max(0.2, np.float64(over)), 0.0, tag)
    wet = 1.0 - 0.38 * look.numbers[2]
    depth = canvas.depth[y, a:b]
    for q in range(3):
        channel = canvas.red if q == 0 else (canvas.green if q == 1 else canvas.blue)
        light = wet * (look.ambient[q] + look.sun_colour[q] * look.sun[2])
        haze_span(channel[a:b], depth, F(look.numbers[0]), F(light), F(255.0 * look.horizon[q]))
