"""Where scenery finds room: nothing but grass, and nothing placed there before."""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.arrays import Float64, UInt8
from di_envs.sensors.scene.raster import TEXEL_M
from di_envs.sensors.scene.surfaces import GRASS


class FreeGround:
    """Where there is nothing but grass, by sums over the raster at half a metre."""

    _STEP = 3  # texels a cell

    def __init__(self, classes: UInt8, origin: Float64) -> None:
        """Finds what is taken.

        Args:
            classes: (H, W) classes of the plane's raster.
            origin: (2,) x, y of the raster's corner [m].
        """
        rows, columns = (side // self._STEP for side in classes.shape)
        whole = classes[: rows * self._STEP, : columns * self._STEP] != GRASS
        self._taken = whole.reshape(rows, self._STEP, columns, self._STEP).any(axis=(1, 3))
        self._origin, self._cell = origin, self._STEP * TEXEL_M
        self._sum_up()

    def _sum_up(self) -> None:
        self._sums = np.pad(np.cumsum(np.cumsum(self._taken, axis=0), axis=1), ((1, 0), (1, 0)))

    @property
    def size_m(self) -> tuple[float, float]:
        """Extent in x and y."""
        rows, columns = self._taken.shape
        return columns * self._cell, rows * self._cell

    def _cells(self, x: float, y: float, half_x: float, half_y: float) -> tuple[int, int, int, int]:
        i0 = math.floor((x - half_x - self._origin[0]) / self._cell)
        i1 = math.ceil((x + half_x - self._origin[0]) / self._cell)
        j0 = math.floor((y - half_y - self._origin[1]) / self._cell)
        j1 = math.ceil((y + half_y - self._origin[1]) / self._cell)
        return i0, i1, j0, j1

    def is_free(self, x: float, y: float, half_x: float, half_y: float) -> bool:
        """Whether a rectangle along the axes lies on grass alone, inside the raster."""
        i0, i1, j0, j1 = self._cells(x, y, half_x, half_y)
        rows, columns = self._taken.shape
        if i0 < 0 or j0 < 0 or i1 > columns or j1 > rows:
            return False
        sums = self._sums
        return int(sums[j1, i1] - sums[j0, i1] - sums[j1, i0] + sums[j0, i0]) == 0

    def take(self, places: list[tuple[float, float, float, float]]) -> None:
        """Marks rectangles (x, y, half x, half y) as no longer free."""
        rows, columns = self._taken.shape
        for place in places:
            i0, i1, j0, j1 = self._cells(*place)
            self._taken[max(j0, 0) : min(j1, rows), max(i0, 0) : min(i1, columns)] = True
        self._sum_up()
