"""How a class of ground looks, texel by texel: its colour, a grain, slow variation, low places."""

from __future__ import annotations

import numpy as np

from di_envs.numerics.arrays import Float32, UInt8, UInt32
from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, keyed_hash, uniform
from di_envs.sensors.scene.raster import pack
from di_envs.sensors.scene.tags import TAG_BITS

_COARSE = 4  # texels between the places at which slow variation is drawn
_BROAD, _FINE = 24, 9  # texels over which it varies
_SCENERY = int(Stream.SCENERY)
_LOWEST = 7


@kernel
def colour_classes(
    classes: UInt8, colours: Float32, grain: Float32, tags: UInt8, holds_water: UInt8, level: UInt32
) -> None:
    """Colours classes, with a grain and slow variation, and says how low each road texel lies.

    Args:
        classes: (rows, columns) class of each texel.
        colours: (K, 3) of the classes, in levels.
        grain: (K,) how much brightness varies, in levels.
        tags: (K,) `Tag` of the classes.
        holds_water: (K,) whether places of a class lie low.
        level: (rows, columns) written: the finest texels.
    """
    rows, columns = classes.shape
    coarse = np.zeros((rows // _COARSE + 2, columns // _COARSE + 2, 2))
    for i in range(coarse.shape[0]):
        for j in range(coarse.shape[1]):
            coarse[i, j, 0] = _smooth(j * _COARSE, i * _COARSE, _BROAD) - 0.5
            fine = _smooth(j * _COARSE + 9000, i * _COARSE, _FINE)
            coarse[i, j, 1] = 8.0 * (0.5 * coarse[i, j, 0] + 0.25 + 0.5 * fine)
    for i in range(rows):
        k, v = i // _COARSE, (i % _COARSE) / _COARSE
        for j in range(columns):
            m, u = j // _COARSE, (j % _COARSE) / _COARSE
            class_ = classes[i, j]
            slow = _between(coarse[k, m, 0], coarse[k, m + 1, 0],
                            coarse[k + 1, m, 0], coarse[k + 1, m + 1, 0], u, v)  # fmt: skip
            low = 0
            if holds_water[class_] != 0:
                low = int(_between(coarse[k, m, 1], coarse[k, m + 1, 1],
                                   coarse[k + 1, m, 1], coarse[k + 1, m + 1, 1], u, v))  # fmt: skip
            noise = float(keyed_hash(1, _SCENERY, i, j) & np.uint64(255)) / 255.0 - 0.5
            add = grain[class_] * (noise + 0.7 * slow)
            level[i, j] = pack(
                colours[class_, 0] + add,
                colours[class_, 1] + add,
                colours[class_, 2] + add,
                tags[class_] | (min(max(low, 0), _LOWEST) << TAG_BITS),
            )


@kernel
def _smooth(column: int, row: int, cell: int) -> float:
    """A number in [0, 1) that varies smoothly over some `cell` texels."""
    i, j = column // cell, row // cell
    u, v = (column - i * cell) / cell, (row - j * cell) / cell
    u, v = u * u * (3.0 - 2.0 * u), v * v * (3.0 - 2.0 * v)
    near = uniform(0, _SCENERY, i, j) * (1.0 - u) + uniform(0, _SCENERY, i + 1, j) * u
    far = uniform(0, _SCENERY, i, j + 1) * (1.0 - u) + uniform(0, _SCENERY, i + 1, j + 1) * u
    return near * (1.0 - v) + far * v


@kernel
def _between(a: float, b: float, c: float, d: float, u: float, v: float) -> float:
    """Between four corners: a and b above, c and d below; u to the right, v down, both 0..1."""
    return (a * (1.0 - u) + b * u) * (1.0 - v) + (c * (1.0 - u) + d * u) * v
