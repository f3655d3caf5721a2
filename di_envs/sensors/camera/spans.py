"""The innermost loops of the cameras: small functions over slices of one row of pixels.

Each works on contiguous single-precision slices from 0 on and calls nothing, which is what lets
LLVM vectorise it. Slices are (N,), N pixels, of whole blocks of `BLOCK`: a rest that is worked out
pixel by pixel costs more than most spans are long. What lies beyond a span's end in its last block
is left as it was, or is painted over, as rows are painted from left to right.

Colours are in levels (0..255) until `store_row`. `depth` is metres ahead of the camera's plane; a
pixel's place along the row is `first + index`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.arrays import Float32, Int32, UInt8
from di_envs.numerics.kernels import kernel

F = np.float32
ONE, ZERO, HALF, FULL = F(1.0), F(0.0), F(0.5), F(255.0)
NEAR_M = F(0.1)
BLOCK = 8  # pixels; the loops say so to LLVM by ending at `N // BLOCK * BLOCK`
RGB = tuple[F, F, F]  # of one colour, in levels, or what multiplies them


class BoxRays(NamedTuple):
    """The rays of one row of pixels and the box that they are tested against, in its frame [m].

    The ray of column k goes from the eye along `start + k step`, which is 1 ahead of the camera.
    """

    eye_x: F
    eye_y: F
    eye_z: F
    start_x: F
    start_y: F
    start_z: F
    step_x: F
    step_y: F
    step_z: F
    half_x: F  # half sides of the box
    half_y: F
    half_z: F


class Axis(NamedTuple):
    """Where rays end along one axis: at `start + depth (gain + column turn)`."""

    start: F  # of the camera
    gain: F  # what a metre of depth adds at column 0
    turn: F  # what each column adds to that


@kernel
def whole(pixels: int) -> int:
    """So many pixels, rounded up to whole blocks."""
    return (pixels + (BLOCK - 1)) // BLOCK * BLOCK


@kernel
def hit_box(depth: Float32, code: Int32, first: F, end: F, box: np.int32, rays: BoxRays) -> None:
    """Intersects a span of rays with one box; the nearer hit stays.

    Args:
        depth: (N,) nearest hit so far.
        code: (N,) what it was: 6 times the box's number and the face.
        first: Column of the span's first pixel.
        end: Column of the first one beyond it, from where on nothing is hit.
        box: 6 times the box's number.
        rays: Of the row.
    """
    nx, px = -rays.half_x - rays.eye_x, rays.half_x - rays.eye_x
    ny, py = -rays.half_y - rays.eye_y, rays.half_y - rays.eye_y
    nz, pz = -rays.half_z - rays.eye_z, rays.half_z - rays.eye_z
    ax, ay, az = rays.start_x, rays.start_y, rays.start_z
    bx, by, bz = rays.step_x, rays.step_y, rays.step_z
    for x in range(depth.shape[0] // BLOCK * BLOCK):
        at = F(x) + first
        old = depth[x]
        old_code = code[x]
        dx, dy, dz = ax + at * bx, ay + at * by, az + at * bz
        ix, iy, iz = ONE / dx, ONE / dy, ONE / dz
        x1, x2 = nx * ix, px * ix
        y1, y2 = ny * iy, py * iy
        z1, z2 = nz * iz, pz * iz
        in_x = x1 if x1 < x2 else x2
        out_x = x2 if x1 < x2 else x1
        in_y = y1 if y1 < y2 else y2
        out_y = y2 if y1 < y2 else y1
        in_z = z1 if z1 < z2 else z2
        out_z = z2 if z1 < z2 else z1
        enter = in_y if in_y > in_z else in_z
        enter = in_x if in_x > enter else enter
        leave = out_y if out_y < out_z else out_z
        leave = out_x if out_x < leave else leave
        hit = (enter <= leave) & (enter > NEAR_M) & (enter < old) & (at < end)
        face_x = np.int32(dx >= ZERO)
        face_y = np.int32(2) + np.int32(dy >= ZERO)
        face_z = np.int32(4) + np.int32(dz >= ZERO)
        face = face_x if enter == in_x else (face_y if enter == in_y else face_z)
        depth[x] = enter if hit else old
        code[x] = box + face if hit else old_code


@kernel
def hit_upright(
    depth: Float32, code: Int32, first: F, end: F, box: np.int32, rays: BoxRays
) -> None:
    """`hit_box` for a box without pitch: a row's rays rise alike at every column."""
    nx, px = -rays.half_x - rays.eye_x, rays.half_x - rays.eye_x
    ny, py = -rays.half_y - rays.eye_y, rays.half_y - rays.eye_y
    ax, ay, dz = rays.start_x, rays.start_y, rays.start_z
    bx, by = rays.step_x, rays.step_y
    iz = ONE / dz
    z1, z2 = (-rays.half_z - rays.eye_z) * iz, (rays.half_z - rays.eye_z) * iz
    in_z = z1 if z1 < z2 else z2
    out_z = z2 if z1 < z2 else z1
    face_z = np.int32(4) + np.int32(dz >= ZERO)
    for x in range(depth.shape[0] // BLOCK * BLOCK):
        at = F(x) + first
        old = depth[x]
        old_code = code[x]
        dx, dy = ax + at * bx, ay + at * by
        ix, iy = ONE / dx, ONE / dy
        x1, x2 = nx * ix, px * ix
        y1, y2 = ny * iy, py * iy
        in_x = x1 if x1 < x2 else x2
        out_x = x2 if x1 < x2 else x1
        in_y = y1 if y1 < y2 else y2
        out_y = y2 if y1 < y2 else y1
        enter = in_y if in_y > in_z else in_z
        enter = in_x if in_x > enter else enter
        leave = out_y if out_y < out_z else out_z
        leave = out_x if out_x < leave else leave
        hit = (enter <= leave) & (enter > NEAR_M) & (enter < old) & (at < end)
        face_x = np.int32(dx >= ZERO)
        face_y = np.int32(2) + np.int32(dy >= ZERO)
        face = face_x if enter == in_x else (face_y if enter == in_y else face_z)
        depth[x] = enter if hit else old
        code[x] = box + face if hit else old_code


@kernel
def fill(values: NDArray[Any], value: Any) -> None:
    """Sets a span to one value."""
    for x in range(values.shape[0]):
        values[x] = value


@kernel
def copy(values: Float32, source: Float32) -> None:
    """Copies a span of any length."""
    for x in range(values.shape[0]):
        values[x] = source[x]


@kernel
def light_ground(
    red: Float32, green: Float32, blue: Float32, shadow: Float32, lit: RGB, dark: RGB, add: RGB
) -> None:
    """Lights a span of ground: by `lit`, in shadow by `dark`, and adds haze."""
    lit_r, lit_g, lit_b = lit
    r, g, b = dark[0] - lit_r, dark[1] - lit_g, dark[2] - lit_b
    add_r, add_g, add_b = add
    for x in range(shadow.shape[0] // BLOCK * BLOCK):
        k = shadow[x]
        red[x] = red[x] * (lit_r + r * k) + add_r
        green[x] = green[x] * (lit_g + g * k) + add_g
        blue[x] = blue[x] * (lit_b + b * k) + add_b


@kernel
def shade_span(shadow: Float32, first: F, start: F, end: F, strength: F) -> None:
    """Marks a stretch of a row as in shadow, its ends softened over a pixel.

    Args:
        shadow: (N,) how much of the sun is hidden, 0..1; only ever raised.
        first: Column of the span's first pixel.
        start: Column at which the shadow begins, between pixels too.
        end: Column at which it ends.
        strength: 0..1, less for what is thinner than a pixel.
    """
    for x in range(shadow.shape[0] // BLOCK * BLOCK):
        at = first + F(x)
        a, b = at - start + HALF, end - at + HALF
        k = a if a < b else b
        k = (k if k < ONE else ONE) * strength
        shadow[x] = k if k > shadow[x] else shadow[x]


@kernel
def flat(
    red: Float32, green: Float32, blue: Float32, depth: Float32, haze: F, colour: RGB, sky: RGB
) -> None:
    """A span of a plain face of one colour, behind `haze` [1/m] of the colour of the sky."""
    sky_r, sky_g, sky_b = sky
    r, g, b = colour[0] - sky_r, colour[1] - sky_g, colour[2] - sky_b
    for x in range(depth.shape[0] // BLOCK * BLOCK):
        k = haze * depth[x]
        w = ONE / (ONE + k + HALF * k * k)
        red[x] = sky_r + r * w
        green[x] = sky_g + g * w
        blue[x] = sky_b + b * w


@kernel
def windows(pattern: Float32, depth: Float32, first: F, along: Axis, up: Axis, pixel: F) -> None:
    """How much of each pixel of a wall is window, 0..1.

    Args:
        pattern: (N,) written.
        depth: (N,) of the wall.
        first: Column of the first pixel.
        along: Place along the wall [m].
        up: Height on the wall [m].
        pixel: Metres a pixel at 1 m.
    """
    for x in range(depth.shape[0] // BLOCK * BLOCK):
        at = F(x) + first
        q = (along.start + depth[x] * (along.gain + at * along.turn)) / F(2.8)
        p = (up.start + depth[x] * (up.gain + at * up.turn)) / F(3.2)
        q -= np.floor(q)
        p -= np.floor(p)
        blur = depth[x] * pixel / F(2.8) + F(0.02)
        a = F(0.27) - np.abs(q - HALF)
        b = F(0.26) - np.abs(p - HALF)
        k = (a if a < b else b) / blur + HALF
        k = k if k > ZERO else ZERO
        k = k if k < ONE else ONE
        fade = F(1.6) - F(1.6) * blur
        fade = fade if fade > ZERO else ZERO
        fade = fade if fade < ONE else ONE
        pattern[x] = F(0.28) + (k - F(0.28)) * fade


@kernel
def mottle(
    pattern: Float32, depth: Float32, first: F, along: Axis, up: Axis, across: Axis, pixel: F
) -> None:
    """How bright the leaves are at each pixel, around 1. Arguments as for `windows`."""
    for x in range(depth.shape[0] // BLOCK * BLOCK):
        at = F(x) + first
        q = np.int32(np.floor((along.start + depth[x] * (along.gain + at * along.turn)) * F(2.7)))
        p = np.int32(np.floor((up.start + depth[x] * (up.gain + at * up.turn)) * F(2.7)))
        s = np.int32(
            np.floor((across.start + depth[x] * (across.gain + at * across.turn)) * F(2.7))
        )
        # of the products the low 32 bits count, so that eight of them fill a vector
        h = np.uint32(np.uint32(q * 73856093) ^ np.uint32(p * 19349663))
        h = np.uint32(np.uint32(h ^ np.uint32(s * 83492791)) & np.uint32(0xFFFFFF))
        h = np.uint32(np.uint32(np.uint32(h * np.uint32(40503)) >> np.uint32(12)) & np.uint32(255))
        fade = F(1.3) - depth[x] * pixel * F(2.5)
        fade = fade if fade > ZERO else ZERO
        fade = fade if fade < ONE else ONE
        pattern[x] = ONE + (F(np.int32(h)) / F(255.0) - HALF) * F(0.65) * fade


@kernel
def blend(red: Float32, green: Float32, blue: Float32, pattern: Float32, other: RGB) -> None:
    """Mixes another colour into a span, by a pattern of shares 0..1."""
    r, g, b = other
    for x in range(pattern.shape[0] // BLOCK * BLOCK):
        k = pattern[x]
        red[x] += (r - red[x]) * k
        green[x] += (g - green[x]) * k
        blue[x] += (b - blue[x]) * k


@kernel
def multiply(red: Float32, green: Float32, blue: Float32, pattern: Float32) -> None:
    """Multiplies a span of colours by a pattern."""
    for x in range(pattern.shape[0] // BLOCK * BLOCK):
        k = pattern[x]
        red[x] *= k
        green[x] *= k
        blue[x] *= k


@kernel
def haze_span(
    red: Float32, green: Float32, blue: Float32, depth: Float32, haze: F, light: RGB, sky: RGB
) -> None:
    """Lights a span of a textured face and hides it in `haze` [1/m] of the colour of the sky."""
    light_r, light_g, light_b = light
    sky_r, sky_g, sky_b = sky
    for x in range(depth.shape[0] // BLOCK * BLOCK):
        k = haze * depth[x]
        w = ONE / (ONE + k + HALF * k * k)
        red[x] = sky_r + (red[x] * light_r - sky_r) * w
        green[x] = sky_g + (green[x] * light_g - sky_g) * w
        blue[x] = sky_b + (blue[x] * light_b - sky_b) * w


@kernel
def store_row(red: Float32, green: Float32, blue: Float32, row: UInt8) -> None:
    """Writes a row's colours as bytes to that of an image, (3 W,)."""
    for x in range(row.shape[0] // 3):
        r, g, b = red[x], green[x], blue[x]
        r = r if r < FULL else FULL
        g = g if g < FULL else FULL
        b = b if b < FULL else FULL
        row[3 * x] = np.uint8(np.int32(r))
        row[3 * x + 1] = np.uint8(np.int32(g))
        row[3 * x + 2] = np.uint8(np.int32(b))


@kernel
def beam_span(factor: Float32, depth: Float32, gain: F, u0: F, du: F) -> None:
    """By how much each pixel is brighter that stands in the ego's own beam.

    Args:
        factor: (N,) written, from 1 up.
        depth: (N,) of the whole row.
        gain: Right before the headlights.
        u0: How far to the right a ray of the first pixel goes, 1 ahead.
        du: What each column adds to it.
    """
    for x in range(depth.shape[0] // BLOCK * BLOCK):
        z = depth[x]
        side = (u0 + F(x) * du) * z / (F(2.2) + F(0.22) * z)
        far = z / F(13.0)
        factor[x] = ONE + gain / ((ONE + far * far) * (ONE + side * side))
