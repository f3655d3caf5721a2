"""The town seen from above as square tiles of pixels, each drawn when it is first looked at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from di_envs.drawing.outlines import BRIDGE_M, LAND, SURFACE, Array, crosswalk_bars, surfaces
from di_envs.town.map_chunks import MapKind, map_chunks_of
from di_envs.town.town import Town

TILE_PX = 512
KEPT = 64  # tiles of each level that are kept, 1 MB each

_LINE, _FAINT_LINE, _BAR, _RIM = "#b6b9bd", "#a3a7ac", "#b0b3b8", "#3a3f45"
_LINE_M, _RIM_M = 0.18, 0.9


@dataclass(frozen=True, kw_only=True)
class _Shape:
    """Something flat on the ground [m]: an area, or a line of some width."""

    points: Array  # (P, 2)
    colour: str
    width_m: float = 0.0  # 0 for an area


class MapTiles:
    """Draws the town in pixels of `1 / scale` metres, world x to the right and y down."""

    def __init__(self, town: Town, scale: float) -> None:
        """Collects what there is to draw.

        Args:
            town: The town.
            scale: Pixels a metre.
        """
        self.scale = scale
        shapes = {above: _shapes_of(town, above) for above in (False, True)}
        self._shapes = shapes
        self._boxes = {above: _boxes(shapes[above]) for above in shapes}
        self._tile = lru_cache(2 * KEPT)(self._drawn)

    def paste(self, picture: Any, left: int, top: int, *, above: bool) -> bool:
        """Draws a window of the map onto a picture of its size.

        Args:
            picture: An RGB image, changed in place.
            left: Column of the window's corner [px]; the world's origin is at 0.
            top: Row of it.
            above: Whether to draw the bridges, over what is there, or the ground.

        Returns:
            Whether there was anything to draw.
        """
        drawn = False
        for column in range(left // TILE_PX, (left + picture.width - 1) // TILE_PX + 1):
            for row in range(top // TILE_PX, (top + picture.height - 1) // TILE_PX + 1):
                tile, (x, y) = self._tile(column, row, above)
                if tile is not None:
                    place = column * TILE_PX - left + x, row * TILE_PX - top + y
                    picture.paste(tile, place, tile if above else None)
                    drawn = True
        return drawn

    def _drawn(self, column: int, row: int, above: bool) -> tuple[Any, tuple[int, int]]:
        """A tile and where it begins; of bridges only what holds them, None where there is none."""
        corner = np.array([column, row]) * TILE_PX / self.scale
        low, high = self._boxes[above]
        seen = np.flatnonzero(
            ((low <= corner + TILE_PX / self.scale) & (high >= corner)).all(axis=1)
        )
        if above and not len(seen):
            return None, (0, 0)
        mode, land = ("RGBA", (0, 0, 0, 0)) if above else ("RGB", LAND)
        tile = Image.new(mode, (TILE_PX, TILE_PX), land)
        pen = ImageDraw.Draw(tile)
        for index in seen.tolist():
            shape = self._shapes[above][index]
            points = ((shape.points - corner) * self.scale).ravel().tolist()
            if shape.width_m:
                width = max(1, round(shape.width_m * self.scale))
                pen.line(points, shape.colour, width, joint="curve")
            else:
                pen.polygon(points, shape.colour)
        filled = tile.getbbox() if above else (0, 0, TILE_PX, TILE_PX)
        return (tile.crop(filled), filled[:2]) if filled else (None, (0, 0))


def _shapes_of(town: Town, above: bool) -> list[_Shape]:
    """Surfaces, crosswalks and lane lines of one level, in the order in which they are laid."""
    outlines = {kind: surfaces(town.lanes, kind, above) for kind in SURFACE}
    shapes = []
    if above:  # a rim along both sides, of which the lanes cover all but the outermost
        sides = [side for each in outlines.values() for area in each for side in np.split(area, 2)]
        shapes += [_Shape(points=side, colour=_RIM, width_m=_RIM_M) for side in sides]
    for kind, areas in outlines.items():
        shapes += [_Shape(points=area, colour=SURFACE[kind]) for area in areas]
    if not above:
        bars = crosswalk_bars(town.crosswalks)
        shapes += [_Shape(points=bar, colour=_BAR) for bar in bars]
    chunks = map_chunks_of(town)
    high = chunks.points[:, :, 2].mean(axis=1) > BRIDGE_M
    for index in np.flatnonzero((high == above) & (chunks.kind[:, 0] != MapKind.LANE_CENTRE)):
        line = chunks.points[index, :, :2]
        if chunks.kind[index, 0] == MapKind.SOLID_LINE:
            shapes.append(_Shape(points=line, colour=_LINE, width_m=_LINE_M))
        else:
            dashes = [line[begin : begin + 2] for begin in range(0, len(line) - 1, 2)]
            shapes += [_Shape(points=dash, colour=_FAINT_LINE, width_m=_LINE_M) for dash in dashes]
    return shapes


def _boxes(shapes: list[_Shape]) -> tuple[NDArray[Any], NDArray[Any]]:
    """The corners (N, 2) of the boxes that hold the shapes [m]."""
    if not shapes:
        return np.zeros((0, 2)), np.zeros((0, 2))
    low = np.array([shape.points.min(axis=0) - shape.width_m for shape in shapes])
    high = np.array([shape.points.max(axis=0) + shape.width_m for shape in shapes])
    return low, high
