"""Where the runs of equal faces in a row of pixels end, eight pixels at a time."""

from __future__ import annotations

import numpy as np

from di_envs.numerics.arrays import Int32, UInt8, UInt64
from di_envs.numerics.kernels import kernel
from di_envs.sensors.camera.spans import BLOCK

_ALL, _ONE, _TOP = np.uint64(2**64 - 1), np.uint64(1), np.uint64(56)
_NUMBERS = np.uint64(0x0001020304050607)  # times 1 in byte k, its highest byte is k


@kernel
def mark_ends(code: Int32, ends: UInt8) -> None:
    """Marks the last pixel of each run of equal codes with 1, others with 0.

    Args:
        code: (N + 1,) or longer.
        ends: (N,) written.
    """
    for x in range(ends.shape[0] // BLOCK * BLOCK):
        ends[x] = np.uint8(code[x] != code[x + 1])


@kernel
def run_end(ends: UInt8, words: UInt64, start: int, end: int) -> int:
    """Where the run that goes on at `start` is over; at `end`, if not before.

    Args:
        ends: Of the row, as `mark_ends` writes them.
        words: The same memory, eight pixels a word, the first in its lowest byte.
        start, end: Columns.
    """
    at = start // BLOCK
    word = words[at] & (_ALL << np.uint64(BLOCK * (start - BLOCK * at)))
    while word == 0:
        at += 1
        if BLOCK * at >= end:
            return end
        word = words[at]
    lowest = word & (~word + _ONE)  # 1 in one of eight bytes: its number comes to the top
    return min(end, BLOCK * at + int((lowest * _NUMBERS) >> _TOP) + 1)
