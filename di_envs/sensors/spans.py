# mypy: disallow_untyped_defs=False
"""The innermost loops of the cameras: small functions over slices of one row of pixels.

Each works on contiguous single-precision slices from 0 on and calls nothing, which is what lets
LLVM vectorise it. Colours are in levels (0..255) until `store_row`. `depth` is metres ahead of the
camera's plane; a pixel's place along the row is `first + index`.
"""

from __future__ import annotations

import numpy as np

from di_envs.kernels import kernel

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
def fill(values, value):
    """Sets a span to one value."""
    for x in range(values.shape[0]):
        values[x] = value


@kernel
def plane_points(places, depth, stride, start, gain, turn, first):
    """Where the rays of every `stride`-th pixel end, in texels along one axis.

    Args:
        places: (N,) written.
        depth: Of the row's pixels, from the span's first on.
        stride: Pixels from one place to the next.
        start: Of the camera.
        gain: What a metre of depth adds at column 0.
        turn: What each column adds to that.
        first: Column of the span's first pixel.
    """
    end = depth.shape[0] - 1
    for x in range(places.shape[0]):
        i = x * stride
        z = depth[i if i < end else end]
        places[x] = start + z * (gain + (first + F(i)) * turn)


@kernel
def sample(u, v, red, green, blue, texels, start, width, height, scale, weight):
    """Adds bilinear samples of one level of a raster to a span.

    Args:
        u, v: (N,) places in texels of the finest level.
        red, green, blue: (N,) to add to.
        texels: All levels of the raster.
        start, width, height: Of the level.
        scale: Its texels for one of the finest level.
        weight: Of this sample.
    """
    top_u, top_v = F(width) - F(1.01), F(height) - F(1.01)
    share = weight / F(256.0)
    for x in range(u.shape[0]):
        a = u[x] * scale - HALF
        b = v[x] * scale - HALF
        a = a if a > ZERO else ZERO
        b = b if b > ZERO else ZERO
        a = a if a < top_u else top_u
        b = b if b < top_v else top_v
        i, j = np.int64(a), np.int64(b)
        p = np.int64((a - F(i)) * F(16.0))
        q = np.int64((b - F(j)) * F(16.0))
        at = start + j * width + i
        t00, t01 = np.int64(texels[at]), np.int64(texels[at + 1])
        t10, t11 = np.int64(texels[at + width]), np.int64(texels[at + width + 1])
        w11 = p * q
        w01 = (p << 4) - w11
        w10 = (q << 4) - w11
        w00 = 256 - w11 - w01 - w10
        # the three colours side by side in one word, 16 bits each, weighed by 256ths
        s = ((t00 & 0xFF00FF) | ((t00 & 0xFF00) << 24)) * w00
        s += ((t01 & 0xFF00FF) | ((t01 & 0xFF00) << 24)) * w01
        s += ((t10 & 0xFF00FF) | ((t10 & 0xFF00) << 24)) * w10
        s += ((t11 & 0xFF00FF) | ((t11 & 0xFF00) << 24)) * w11
        red[x] += F(s & 0xFFFF) * share
        green[x] += F((s >> 32) & 0xFFFF) * share
        blue[x] += F((s >> 16) & 0xFFFF) * share


@kernel
def last_bytes(u, v, last, texels, width, height):
    """Reads the last byte of the nearest texel of the finest level."""
    for x in range(u.shape[0]):
        i, j = int(u[x]), int(v[x])
        i = i if i > 0 else 0
        j = j if j > 0 else 0
        i = i if i < width else width - 1
        j = j if j < height else height - 1
        last[x] = np.uint8(texels[j * width + i] >> 24)


@kernel
def tags_of(last, tag):
    """The tags in texels' last bytes."""
    for x in range(last.shape[0]):
        tag[x] = last[x] & np.uint8(31)


@kernel
def spread(samples, colour, stride):
    """Fills in a span from samples of every second, fourth or eighth pixel."""
    whole = colour.shape[0] // stride
    if stride == 8:  # loops of a known length become straight vector code
        for k in range(whole):
            value, step = samples[k], (samples[k + 1] - samples[k]) * F(0.125)
            for i in range(8):
                colour[8 * k + i] = value + F(i) * step
    elif stride == 4:
        for k in range(whole):
            value, step = samples[k], (samples[k + 1] - samples[k]) * F(0.25)
            for i in range(4):
                colour[4 * k + i] = value + F(i) * step
    else:
        for k in range(whole):
            colour[2 * k] = samples[k]
            colour[2 * k + 1] = HALF * (samples[k] + samples[k + 1])
    for x in range(whole * stride, colour.shape[0]):
        share = F(x - whole * stride) / F(stride)
        colour[x] = samples[whole] + (samples[whole + 1] - samples[whole]) * share


@kernel
def light_ground(colour, shadow, lit, dark, add):
    """Lights one channel of a span of ground: by `lit`, in shadow by `dark`, and adds haze."""
    for x in range(colour.shape[0]):
        colour[x] = colour[x] * (lit + (dark - lit) * shadow[x]) + add


@kernel
def puddles(last, red, green, blue, level, share, r, g, b):
    """Covers the low places of a span with water that shows the sky."""
    for x in range(last.shape[0]):
        tag = last[x] & 31
        deep = F(level) - F(last[x] >> 5)
        deep = deep if deep < F(2.0) else F(2.0)
        k = share * HALF * deep if deep > ZERO and (tag == 1 or tag == 24) else ZERO
        red[x] += (r - red[x]) * k
        green[x] += (g - green[x]) * k
        blue[x] += (b - blue[x]) * k


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
def headlights(colour, depth, gain, u0, du):
    """Brightens what stands in the ego's own beam."""
    for x in range(depth.shape[0]):
        z = depth[x]
        side = (u0 + F(x) * du) * z / (F(2.2) + F(0.22) * z)
        far = z / F(13.0)
        colour[x] *= ONE + gain / ((ONE + far * far) * (ONE + side * side))


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
