"""The town from above as SVG: what a page shows as a map, and what its replay draws streets from.

Units are centimetres, x to the right and y down, as in the world. Shapes of one look that lie in
one square of the town are one path, so that whoever draws a window passes over most of them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from di_envs.drawing.outlines import (
    BRIDGE_M,
    SURFACE,
    Array,
    crosswalk_bars,
    stop_line_ends,
    surfaces,
)
from di_envs.town.lanes import SignalKind
from di_envs.town.map_chunks import MapKind, build_map_chunks
from di_envs.town.town import Town

CM = 100.0
CELL_M = 120.0  # side of the squares
CLOSE_M = 0.04  # how far a simplified outline may be from what it stands for
RIM_FROM_M = BRIDGE_M + 1.5  # lower down a lane may be of the bridge and its neighbour not yet
_LINES = {MapKind.BROKEN_LINE: "broken", MapKind.SOLID_LINE: "solid"}


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """What the town lies within [m]."""

    left: float
    top: float
    width: float
    height: float


def town_bounds(town: Town, margin_m: float = 12.0) -> Bounds:
    """The box around all lanes, with a margin."""
    low = town.lanes.points[:, :2].min(axis=0) - margin_m
    size = town.lanes.points[:, :2].max(axis=0) + margin_m - low
    return Bounds(
        left=float(low[0]), top=float(low[1]), width=float(size[0]), height=float(size[1])
    )


def town_svg(town: Town) -> str:
    """The streets as SVG elements: the ground's first, then those of bridges.

    Each path has a class that names what it is (a kind of lane, `bar` of crosswalks, `solid` or
    `broken` line, the `rim` of bridges), `data-level` 0 or 1, and `data-box`, the centimetres that
    it lies within. Stop lines are of class `stop`, those of lights with `data-light`.
    """
    parts: list[str] = []
    for above in (False, True):
        for name, outlines in _layers(town, above):
            parts += _paths(name, outlines, above)
        parts += _stop_lines(town, above)
    return "\n".join(parts)


def line_path(points: NDArray[np.float64], *, closed: bool = False) -> str:
    """An SVG path through (N, 2) points [m], in whole centimetres, relative to the first."""
    whole = np.rint(points[:, :2] * CM).astype(int)
    steps = np.diff(whole, axis=0)
    steps = steps[(steps != 0).any(axis=1)]
    start = f"M{whole[0, 0]} {whole[0, 1]}l"
    return start + _pairs(steps) + ("z" if closed else "")


def _pairs(steps: NDArray[np.int64]) -> str:
    """Numbers with no more between them than it takes to tell them apart."""
    text = " ".join(f"{x} {y}" for x, y in steps.tolist())
    return text.replace(" -", "-")


def simplified(points: NDArray[np.float64], close_m: float = CLOSE_M) -> NDArray[np.float64]:
    """The line through fewer of the (N, 2) points, nowhere further away than `close_m`.

    Source: Douglas and Peucker, "Algorithms for the reduction of the number of points required to
    represent a digitized line or its caricature", Cartographica 1973.
    """
    keep = np.zeros(len(points), bool)
    keep[[0, -1]] = True
    spans = [(0, len(points) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        away = _away(points[first + 1 : last], points[first], points[last])
        worst = int(np.argmax(away))
        if away[worst] > close_m:
            middle = first + 1 + worst
            keep[middle] = True
            spans += [(first, middle), (middle, last)]
    return points[keep]


def _away(points: Array, start: Array, end: Array) -> Array:
    """How far points are from the straight piece between two others."""
    along = end - start
    length2 = float(along @ along)
    share = np.clip((points - start) @ along / length2, 0.0, 1.0) if length2 else 0.0
    feet = start + np.multiply.outer(np.broadcast_to(share, len(points)), along)
    return np.asarray(np.linalg.norm(points - feet, axis=1))


def _layers(town: Town, above: bool) -> Iterator[tuple[str, list[Array]]]:
    """What there is of one level by its name, in the order in which it is laid."""
    areas = {kind: surfaces(town.lanes, kind, above) for kind in SURFACE}
    if above:
        high_up = (surfaces(town.lanes, kind, above, RIM_FROM_M) for kind in SURFACE)
        sides = (side for each in high_up for area in each for side in np.split(area, 2))
        yield "rim", [simplified(side) for side in sides]
    for kind, outlines in areas.items():
        yield kind.name.lower(), [_simpler_area(outline) for outline in outlines]
    if not above:
        yield "bar", crosswalk_bars(town.crosswalks)
    chunks = build_map_chunks(town.lanes)
    high = chunks.points[:, :, 2].mean(axis=1) > BRIDGE_M
    for line, name in _LINES.items():
        rows = np.flatnonzero((high == above) & (chunks.kind[:, 0] == line))
        yield name, [simplified(chunks.points[row, :, :2]) for row in rows]


def _simpler_area(outline: Array) -> Array:
    """An outline whose first half is one side and whose second half is the other, backwards."""
    return np.concatenate([simplified(side) for side in np.split(outline, 2)])


def _paths(name: str, outlines: Iterable[Array], above: bool) -> Iterator[str]:
    """A path for each square that holds any."""
    cells: dict[tuple[int, int], list[Array]] = defaultdict(list)
    for outline in outlines:
        column, row = np.floor(outline.mean(axis=0) / CELL_M).astype(int).tolist()
        cells[(column, row)].append(outline)
    closed = name not in ("rim", *_LINES.values())
    for _, inside in sorted(cells.items()):
        points = np.concatenate(inside)
        low, high = np.floor(points.min(axis=0) * CM), np.ceil(points.max(axis=0) * CM)
        box = " ".join(f"{value:.0f}" for value in (*low, *high))
        path = "".join(line_path(outline, closed=closed) for outline in inside)
        yield f'<path class="{name}" data-level="{int(above)}" data-box="{box}" d="{path}"/>'


def _stop_lines(town: Town, above: bool) -> Iterator[str]:
    signals = town.signals
    ends = stop_line_ends(signals)
    for line in np.flatnonzero((signals.stop_pose[:, 2] > BRIDGE_M) == above).tolist():
        signal = int(signals.stop_signal[line])
        light = f' data-light="{signal}"' if signals.kind[signal] == SignalKind.LIGHT else ""
        path = line_path(ends[line])
        yield f'<path class="stop" data-level="{int(above)}"{light} d="{path}"/>'
