"""The innermost loops of the cameras: small functions over slices of one row of pixels.

Each works on contiguous single-precision slices from 0 on and calls nothing, which is what lets
LLVM vectorise it. Colours are in levels (0..255) until `store_row`. `depth` is metres ahead of the
camera's plane; a pixel's place along the row is `first + index`.
"""

from __future__ import annotations

import numpy as np

from di_envs.numerics.kernels import kernel

F = np.float32
ONE, ZERO, HALF, FULL = F(1.0), F(0.0), F(0.5), F(255.0)
NEAR_M = F(0.1)


@kernel
def hit_box(depth, code, first, box, rx, ry, rz, ax, ay, az, bx, by, bz, hx, hy, hz):
    """Intersects a span of rays with one box; the nearer hit stays.

    Args:
        depth: (N,) nearest hit so far.
        code: (N,) what it was: 6 times the box's number and the face.
        first: Column of the span's first pixel.
        box: 6 times the box's number.
        rx, ry, rz: Camera in the box's frame [m].
        ax, ay, az: Ray of column 0 in the box's frame, 1 ahead.
        bx, by, bz: What each column adds to it.
        hx, hy, hz: Half sides of the box.
    """
    nx, px, ny, py, nz, pz = -hx - rx, hx - rx, -hy - ry, hy - ry, -hz - rz, hz - rz
    for x in range(depth.shape[0]):
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
        hit = (enter <= leave) & (enter > NEAR_M) & (enter < old)
        face_x = np.int32(dx >= ZERO)
        face_y = np.int32(2) + np.int32(dy >= ZERO)
        face_z = np.int32(4) + np.int32(dz >= ZERO)
        face = face_x if enter == in_x else (face_y if enter == in_y else face_z)
        depth[x] = enter if hit else old
        code[x] = box + face if hit else old_code


@kernel
def hit_upright(depth, code, first, box, rx, ry, rz, ax, ay, dz, bx, by, hx, hy, hz):
    """`hit_box` for a box without pitch: a row's rays rise alike at every column.

    Args:
        dz: How much they rise, 1 ahead; the rest is as for `hit_box`.
    """
    nx, px, ny, py = -hx - rx, hx - rx, -hy - ry, hy - ry
    iz = ONE / dz
    z1, z2 = (-hz - rz) * iz, (hz - rz) * iz
    in_z = z1 if z1 < z2 else z2
    out_z = z2 if z1 < z2 else z1
    face_z = np.int32(4) + np.int32(dz >= ZERO)
    for x in range(depth.shape[0]):
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
        hit = (enter <= leave) & (enter > NEAR_M) & (enter < old)
        face_x = np.int32(dx >= ZERO)
        face_y = np.int32(2) + np.int32(dy >= ZERO)
        face = face_x if enter == in_x else (face_y if enter == in_y else face_z)
        depth[x] = enter if hit else old
        code[x] = box + face if hit else old_code


@kernel
def fill(values, value):
    """Sets a span to one value."""
    for x in range(values.shape[0]):
        values[x] = value


@kernel
def light_ground(colour, shadow, lit, dark, add):
    """Lights one channel of a span of ground: by `lit`, in shadow by `dark`, and adds haze."""
    for x in range(colour.shape[0]):
        colour[x] = colour[x] * (lit + (dark - lit) * shadow[x]) + add


@kernel
def shade_span(shadow, first, start, end, strength):
    """Marks a stretch of a row as in shadow, its ends softened over a pixel."""
    for x in range(shadow.shape[0]):
        at = first + F(x)
        a, b = at - start + HALF, end - at + HALF
        k = a if a < b else b
        k = (k if k < ONE else ONE) * strength
        shadow[x] = k if k > shadow[x] else shadow[x]


@kernel
def flat(colour, depth, haze, value, sky):
    """One channel of a plain face, in haze."""
    for x in range(depth.shape[0]):
        k = haze * depth[x]
        w = ONE / (ONE + k + HALF * k * k)
        colour[x] = sky + (value - sky) * w


@kernel
def windows(pattern, depth, first, q0, qa, qb, p0, pa, pb, pixel):
    """How much of each pixel of a wall is window, 0..1.

    Args:
        pattern: (N,) written.
        depth: (N,) of the wall.
        first: Column of the first pixel.
        q0, qa, qb: Place along the wall: q0 + depth (qa + column qb).
        p0, pa, pb: Height on the wall alike.
        pixel: Metres a pixel at 1 m.
    """
    for x in range(depth.shape[0]):
        at = F(x) + first
        q = (q0 + depth[x] * (qa + at * qb)) / F(2.8)
        p = (p0 + depth[x] * (pa + at * pb)) / F(3.2)
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
def mottle(pattern, depth, first, q0, qa, qb, p0, pa, pb, s0, sa, sb, pixel):
    """How bright the leaves are at each pixel, around 1. Arguments as for `windows`, s across."""
    for x in range(depth.shape[0]):
        at = F(x) + first
        q = np.int64(np.floor((q0 + depth[x] * (qa + at * qb)) * F(2.7)))
        p = np.int64(np.floor((p0 + depth[x] * (pa + at * pb)) * F(2.7)))
        s = np.int64(np.floor((s0 + depth[x] * (sa + at * sb)) * F(2.7)))
        h = (q * 73856093) ^ (p * 19349663) ^ (s * 83492791)
        h = (((h & 0xFFFFFF) * 40503) >> 12) & 255
        fade = F(1.3) - depth[x] * pixel * F(2.5)
        fade = fade if fade > ZERO else ZERO
        fade = fade if fade < ONE else ONE
        pattern[x] = ONE + (F(h) / F(255.0) - HALF) * F(0.65) * fade


@kernel
def blend(colour, pattern, other):
    """Mixes another value into a channel, by a pattern."""
    for x in range(colour.shape[0]):
        colour[x] += (other - colour[x]) * pattern[x]


@kernel
def multiply(colour, pattern):
    """Multiplies a channel by a pattern."""
    for x in range(colour.shape[0]):
        colour[x] *= pattern[x]


@kernel
def haze_span(colour, depth, haze, light, sky):
    """Lights one channel of a textured face and hides it in haze."""
    for x in range(depth.shape[0]):
        k = haze * depth[x]
        w = ONE / (ONE + k + HALF * k * k)
        colour[x] = sky + (colour[x] * light - sky) * w


@kernel
def store_row(red, green, blue, row):
    """Writes a row of colours as bytes."""
    for x in range(red.shape[0]):
        r, g, b = red[x], green[x], blue[x]
        r = r if r < FULL else FULL
        g = g if g < FULL else FULL
        b = b if b < FULL else FULL
        row[3 * x] = np.uint8(r)
        row[3 * x + 1] = np.uint8(g)
        row[3 * x + 2] = np.uint8(b)


@kernel
def beam_span(factor, depth, gain, u0, du):
    """By how much each pixel is brighter that stands in the ego's own beam."""
    for x in range(depth.shape[0]):
        z = depth[x]
        side = (u0 + F(x) * du) * z / (F(2.2) + F(0.22) * z)
        far = z / F(13.0)
        factor[x] = ONE + gain / ((ONE + far * far) * (ONE + side * side))


@kernel
def run_end(code, start, end):
    """Where the run of equal codes that begins at `start` is over; at `end`, if not before."""
    value = code[start]
    x = start + 1
    while x + 16 <= end:  # sixteen at once
        differ = np.int32(0)
        for i in range(16):
            differ = np.int32(differ | np.int32(code[x + i] ^ value))
        if differ != 0:
            break
        x += 16
    while x < end and code[x] == value:
        x += 1
    return x
