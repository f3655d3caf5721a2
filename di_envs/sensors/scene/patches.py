"""Patches of the ground: texels of one class that touch side by side; small ones are paved.

They are found by runs, stretches of a row that are of the class: 17,063 in Town05's ten million
texels. A run belongs to the patch of each run of the row before that it touches.
"""

from __future__ import annotations

import numpy as np

from di_envs.numerics.arrays import Int32, UInt8
from di_envs.numerics.kernels import kernel

_ROW, _BEGIN, _END, _OVER, _SIZE = range(5)  # columns of a run: `_OVER` is one of its patch


@kernel
def pave_patches(classes: UInt8, limit: int, ground: int, paving: int) -> None:
    """Gives patches of a class of at most so many texels another one.

    Args:
        classes: (rows, columns) class of each texel, changed.
        limit: Texels of the largest one that is changed.
        ground: The class of patches.
        paving: The other class.
    """
    runs = _runs_of(classes, ground)
    _join(runs)
    for run in range(runs.shape[0]):
        runs[_first(runs, run), _SIZE] += runs[run, _END] - runs[run, _BEGIN]
    for run in range(runs.shape[0]):
        if runs[_first(runs, run), _SIZE] <= limit:
            classes[runs[run, _ROW], runs[run, _BEGIN] : runs[run, _END]] = paving


@kernel
def _runs_of(classes: UInt8, ground: int) -> Int32:
    """(R, 5) the runs of a class in order, each a patch of its own, of no size yet."""
    rows, columns = classes.shape
    count = 0
    for row in range(rows):
        for column in range(columns):
            begins = column == 0 or classes[row, column - 1] != ground
            count += int(classes[row, column] == ground and begins)
    runs = np.zeros((count, 5), np.int32)
    run = 0
    for row in range(rows):
        column = 0
        while column < columns:
            if classes[row, column] != ground:
                column += 1
                continue
            runs[run, _ROW], runs[run, _BEGIN], runs[run, _OVER] = row, column, run
            while column < columns and classes[row, column] == ground:
                column += 1
            runs[run, _END] = column
            run += 1
    return runs


@kernel
def _join(runs: Int32) -> None:
    """Puts runs that touch into one patch: `above` follows `run` along the row before."""
    above = 0
    for run in range(runs.shape[0]):
        row, begin, end = runs[run, _ROW], runs[run, _BEGIN], runs[run, _END]
        while runs[above, _ROW] < row - 1 or (
            runs[above, _ROW] == row - 1 and runs[above, _END] <= begin
        ):
            above += 1
        other = above
        while runs[other, _ROW] == row - 1 and runs[other, _BEGIN] < end:
            one, two = _first(runs, other), _first(runs, run)
            runs[max(one, two), _OVER] = min(one, two)
            other += 1


@kernel
def _first(runs: Int32, run: int) -> int:
    """The run that stands for a patch; shortens the way to it."""
    while runs[run, _OVER] != run:
        runs[run, _OVER] = runs[runs[run, _OVER], _OVER]
        run = runs[run, _OVER]
    return run
