"""Arrays of keyed draws: `keyed_random`'s numbers, element by element, for many worlds at once.

Plain numpy, for what is drawn between steps and not in kernels: the noise of an edit, say. Element
i of an array is the draw that `keyed_random.uniform(seed, stream, tick, i)` gives, so it is the
same in a batch of any size.
"""

from __future__ import annotations

import hashlib
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Keys = Any  # a whole number, or an array of them: one a world

_STEP, _FIRST, _SECOND = (
    np.uint64(number) for number in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
)
_PAIR = 1000  # stream of the second number that a normal draw takes, as in `keyed_random.normal`
_LIMIT = 2**64


def stream_of(text: str) -> int:
    """A stream for draws that a text names: a hash, far from the numbers of `Stream`."""
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "little")


def keyed_uniforms(
    seed: Keys, stream: int, tick: Keys, shape: tuple[int, ...], first: Keys = 0
) -> NDArray[np.float64]:
    """Numbers in [0, 1).

    Args:
        seed: (...) of each world.
        stream: What the draw is for.
        tick: (...) of each world.
        shape: Of the draws of one world.
        first: (...) key of the first element; the others count on from it.

    Returns:
        (..., *shape).
    """
    part = _mixed(_column(seed))
    part = _mixed(part ^ np.uint64(stream % _LIMIT))
    part = _mixed(part ^ _column(tick))
    counted: NDArray[np.uint64] = np.arange(math.prod(shape), dtype=np.uint64)
    elements: NDArray[np.uint64] = np.add(_column(first), counted)
    drawn = _mixed(part ^ elements) >> np.uint64(11)
    uniforms = drawn.astype(np.float64) * (1.0 / 9007199254740992.0)
    return uniforms.reshape(*uniforms.shape[:-1], *shape)


def keyed_hashes(seed: int, stream: int, tick: int, count: int) -> NDArray[np.uint64]:
    """(count,) `keyed_random.keyed_hash` of the actors from 0 on."""
    part = _mixed(_column(seed))
    part = _mixed(part ^ np.uint64(stream))
    return _mixed(_mixed(part ^ _column(tick)) ^ np.arange(count, dtype=np.uint64))


def keyed_normals(
    seed: Keys, stream: int, tick: Keys, shape: tuple[int, ...], first: Keys = 0
) -> NDArray[np.float64]:
    """Standard normal numbers (Box-Muller); arguments and shape as those of `keyed_uniforms`."""
    radius = np.sqrt(-2.0 * np.log1p(-keyed_uniforms(seed, stream, tick, shape, first)))
    turn = keyed_uniforms(seed, stream + _PAIR, tick, shape, first)
    normals: NDArray[np.float64] = radius * np.cos(2.0 * np.pi * turn)
    return normals


def _column(values: Keys) -> NDArray[np.uint64]:
    """(..., 1): never a scalar, whose arithmetic would warn of wrapping around, as it should."""
    return np.asarray(values).astype(np.uint64)[..., None]


def _mixed(value: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """`keyed_random.mix` of each."""
    value = value + _STEP
    value = (value ^ (value >> np.uint64(30))) * _FIRST
    value = (value ^ (value >> np.uint64(27))) * _SECOND
    return value ^ (value >> np.uint64(31))
