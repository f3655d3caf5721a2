"""Reading rasters of the ground, a span of pixels at a time.

A bilinear sample is made in three passes, as the first and the last are pure arithmetic, which LLVM
vectorises, and only the one between reads from places all over memory. Slices are (N,), N samples,
of whole blocks as in `spans.py`, where not said otherwise.
"""

from __future__ import annotations

import numpy as np

from di_envs.numerics.arrays import Float32, Int32, UInt8, UInt32
from di_envs.numerics.kernels import kernel
from di_envs.sensors.camera.spans import BLOCK, RGB, Axis

F = np.float32
ZERO, HALF = F(0.0), F(0.5)
_U4, _U8, _U16 = np.uint32(4), np.uint32(8), np.uint32(16)
_BYTE, _TWO_BYTES, _RED_BLUE = np.uint32(0xFF), np.uint32(0xFFFF), np.uint32(0xFF00FF)
_WHOLE = np.uint32(256)


@kernel
def every(depth: Float32, stride: int, count: int, found: Float32) -> None:
    """Picks the depths of every `stride`-th pixel of a span.

    Args:
        depth: Of the span's pixels, and no more.
        stride: Pixels from one sample to the next.
        count: Of samples; those beyond the last pixel have its depth.
        found: (count,) or longer, written.
    """
    end = depth.shape[0] - 1
    for x in range(count):
        i = x * stride
        found[x] = depth[i if i < end else end]


@kernel
def texel_places(
    depth: Float32,
    stride: int,
    first: F,
    across: Axis,
    down: Axis,
    index: Int32,
    share: Int32,
    width: int,
    height: int,
    scale: F,
) -> None:
    """Which four texels of a level surround the ends of rays, and how near they are to each.

    Args:
        depth: (N,) of every `stride`-th pixel.
        stride: Pixels from one to the next.
        first: Column of the first.
        across, down: Where rays end in a raster's two directions, in texels of the finest level.
        index: (N,) written: the first texel, counted within the level; the others are the next one
            and the two below.
        share: (N,) written: 16ths of the way to the next texel, times 16, plus 16ths downwards.
        width, height: Of the level.
        scale: Its texels for one of the finest level.
    """
    top_u, top_v = F(width) - F(1.01), F(height) - F(1.01)
    row, apart = np.int32(width), np.int32(stride)
    for x in range(depth.shape[0] // BLOCK * BLOCK):
        z, column = depth[x], first + F(np.int32(np.int32(x) * apart))
        u = across.start + z * (across.gain + column * across.turn)
        v = down.start + z * (down.gain + column * down.turn)
        a = u * scale - HALF
        b = v * scale - HALF
        a = a if a > ZERO else ZERO
        b = b if b > ZERO else ZERO
        a = a if a < top_u else top_u
        b = b if b < top_v else top_v
        i, j = np.int32(a), np.int32(b)
        p = np.int32((a - F(i)) * F(16.0))
        q = np.int32((b - F(j)) * F(16.0))
        index[x] = np.int32(np.int32(j * row) + i)
        share[x] = np.int32(np.int32(p << 4) | q)


@kernel
def fetch(index: Int32, found: UInt32, texels: UInt32, start: int, width: int) -> None:
    """Reads four texels for each place, side by side into `found`, (4 N,).

    Args:
        index: (N,) of any length, as `texel_places` writes it.
        found: (4 N,) or longer, written.
        texels: Of all levels of a raster.
        start: Where the level begins among them.
        width: Of the level.
    """
    first, below = np.uint64(start), np.uint64(width)
    for x in range(index.shape[0]):
        at = first + np.uint64(index[x])  # unsigned: what cannot be negative is not tested for it
        found[4 * x] = texels[at]
        found[4 * x + 1] = texels[at + np.uint64(1)]
        found[4 * x + 2] = texels[at + below]
        found[4 * x + 3] = texels[at + below + np.uint64(1)]


@kernel
def add_colours(
    found: UInt32, share: Int32, red: Float32, green: Float32, blue: Float32, weight: F, more: bool
) -> None:
    """Adds bilinear samples, made of what `fetch` found, to a span of colours.

    Args:
        found: (4 N,) or longer: four texels for each place.
        share: (N,) as `texel_places` writes it.
        red, green, blue: (N,) in levels, added to.
        weight: Of the samples, 0..1.
        more: Whether there are colours already; else they are written.
    """
    part = weight / F(256.0)
    for x in range(share.shape[0] // BLOCK * BLOCK):
        p, q = np.uint32(share[x] >> 4), np.uint32(share[x] & 15)
        a, b, c, d = found[4 * x], found[4 * x + 1], found[4 * x + 2], found[4 * x + 3]
        wd = np.uint32(p * q)  # in 256ths
        wb = np.uint32(np.uint32(p << _U4) - wd)
        wc = np.uint32(np.uint32(q << _U4) - wd)
        wa = np.uint32(_WHOLE - wb - wc - wd)
        # red and blue side by side in one word, 16 bits each
        rb = np.uint32(
            np.uint32(a & _RED_BLUE) * wa
            + np.uint32(b & _RED_BLUE) * wb
            + np.uint32(c & _RED_BLUE) * wc
            + np.uint32(d & _RED_BLUE) * wd
        )
        g = np.uint32(
            np.uint32((a >> _U8) & _BYTE) * wa
            + np.uint32((b >> _U8) & _BYTE) * wb
            + np.uint32((c >> _U8) & _BYTE) * wc
            + np.uint32((d >> _U8) & _BYTE) * wd
        )
        red[x] = (red[x] if more else ZERO) + F(np.int32(rb & _TWO_BYTES)) * part
        green[x] = (green[x] if more else ZERO) + F(np.int32(g)) * part
        blue[x] = (blue[x] if more else ZERO) + F(np.int32(rb >> _U16)) * part


@kernel
def water_depths(found: UInt32, share: Int32, water: Float32, level: F) -> None:
    """How deep water stands at each place, 0 to 2, if roads are under water up to a level 1 to 8.

    The nearest of the four texels says how low the place lies.
    """
    for x in range(water.shape[0] // BLOCK * BLOCK):
        p, q = share[x] >> 4, share[x] & 15
        upper = found[4 * x] if p < 8 else found[4 * x + 1]
        lower = found[4 * x + 2] if p < 8 else found[4 * x + 3]
        last = np.int32((upper if q < 8 else lower) >> np.uint32(24))
        tag = last & 31
        deep = level - F(np.int32(last >> 5))
        deep = deep if deep > ZERO else ZERO
        deep = deep if deep < F(2.0) else F(2.0)
        water[x] = deep if (tag == 1) | (tag == 24) else ZERO


@kernel
def tags_at(
    depth: Float32,
    first: F,
    across: Axis,
    down: Axis,
    tag: UInt8,
    texels: UInt32,
    width: int,
    height: int,
) -> None:
    """Reads the tags of the nearest texels of the finest level; for other arguments see above.

    Args:
        depth: (N,) of each pixel.
        tag: (N,) written; N may be any number.
    """
    for x in range(tag.shape[0]):
        column = first + F(x)
        i = int(across.start + depth[x] * (across.gain + column * across.turn))
        j = int(down.start + depth[x] * (down.gain + column * down.turn))
        i = i if i > 0 else 0
        j = j if j > 0 else 0
        i = i if i < width else width - 1
        j = j if j < height else height - 1
        tag[x] = np.uint8(np.uint8(texels[j * width + i] >> 24) & np.uint8(31))


@kernel
def spread(samples: Float32, colour: Float32, stride: int) -> None:
    """Fills in a span from samples of every second, fourth or eighth pixel.

    Args:
        samples: (N // stride + 1,) or longer: one more than there are, so that each has a next one.
        colour: (N,) written: one channel, or depths of water.
        stride: 2, 4 or 8 pixels from one sample to the next.
    """
    count = colour.shape[0] // stride
    if stride == 8:  # loops of a known length become straight vector code
        for k in range(count):
            value, step = samples[k], (samples[k + 1] - samples[k]) * F(0.125)
            for i in range(8):
                colour[8 * k + i] = value + F(i) * step
    elif stride == 4:
        for k in range(count):
            value, step = samples[k], (samples[k + 1] - samples[k]) * F(0.25)
            for i in range(4):
                colour[4 * k + i] = value + F(i) * step
    else:
        for k in range(count):
            colour[2 * k] = samples[k]
            colour[2 * k + 1] = HALF * (samples[k] + samples[k + 1])


@kernel
def puddles(
    water: Float32, red: Float32, green: Float32, blue: Float32, share: F, sky: RGB
) -> None:
    """Covers the low places of a span with water that shows the sky.

    Args:
        water: (N,) depths, 0 to 2.
        red, green, blue: (N,) in levels, covered.
        share: Of the sky in what is under the deepest water.
        sky: Its red, green and blue, in levels.
    """
    r, g, b = sky
    for x in range(water.shape[0] // BLOCK * BLOCK):
        k = share * HALF * water[x]
        red[x] += (r - red[x]) * k
        green[x] += (g - green[x]) * k
        blue[x] += (b - blue[x]) * k
