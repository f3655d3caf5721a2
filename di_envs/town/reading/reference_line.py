"""Road reference lines: position, heading and curvature at any station, for many roads at once.

OpenDRIVE's own frame (right-handed: x east, y north; heading counter-clockwise). The five shapes
are evaluated in the frame of their own start and then moved to where it lies.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Float64, Int64
from di_envs.town.reading.records import GEOMETRY_SHAPES, GeometryRecord

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)  # exact to 1e-12 for turns below 20 rad
_TABLE_STEPS = 1024  # steps of the arc-length table of a polynomial
_STRAIGHT = 1e-12  # 1/m; arcs flatter than this are lines


class Local(NamedTuple):
    """Points of a shape in the frame of its start: (N,) u ahead, v left, heading, curvature."""

    u: Float64
    v: Float64
    heading: Float64
    curvature: Float64


class Breakpoints:
    """Finds the piece that holds a station, for many owners (roads, lanes) in one call.

    Stations are told apart to well below a micrometre.
    """

    def __init__(self, begins: Sequence[Float64]) -> None:
        """Takes for each owner its pieces' first stations, ascending, at least one."""
        counts = np.array([len(b) for b in begins])
        stations = np.concatenate(begins) if len(begins) else np.zeros(0)
        self._first = np.concatenate([[0], np.cumsum(counts)])
        # Owners follow each other on one axis; a power of two leaves the stations' bits alone.
        self._stride = float(2.0 ** np.ceil(np.log2(np.abs(stations).max(initial=1.0) * 4.0)))
        self._keys = stations + self._stride * np.repeat(np.arange(len(counts)), counts)

    def find(self, owner: Int64, station: Float64) -> Int64:
        """(N,) index, over all owners' pieces, of the last piece that begins at or before."""
        found = np.searchsorted(self._keys, station + self._stride * owner, side="right") - 1
        return np.clip(found, self._first[owner], self._first[owner + 1] - 1)


class Cubics:
    """Piecewise cubics a + b d + c d² + d d³ of many owners (roads, lanes)."""

    def __init__(self, tables: Sequence[Float64]) -> None:
        """Takes for each owner an (n, 5) table: station, a, b, c, d."""
        self._breaks = Breakpoints([table[:, 0] for table in tables])
        self._table = np.concatenate(tables)

    def __call__(self, owner: Int64, station: Float64) -> tuple[Float64, Float64]:
        """(N,) values and slopes at stations."""
        row = self._table[self._breaks.find(owner, station)]
        d = station - row[:, 0]
        a, b, c, e = row[:, 1], row[:, 2], row[:, 3], row[:, 4]
        return a + d * (b + d * (c + d * e)), b + d * (2.0 * c + 3.0 * d * e)


class ReferenceLines:
    """The reference lines of all roads."""

    def __init__(self, roads: Sequence[Sequence[GeometryRecord]]) -> None:
        self._pieces = [piece for pieces in roads for piece in pieces]
        self._breaks = Breakpoints([np.array([p.begin for p in pieces]) for pieces in roads])
        columns = [(p.begin, p.length, p.x, p.y, p.heading) for p in self._pieces]
        self._table = np.array(columns, dtype=np.float64).reshape(-1, 5)
        self._shape = np.array([GEOMETRY_SHAPES.index(p.shape) for p in self._pieces])
        self._curvatures = np.array([_curvatures(p) for p in self._pieces]).reshape(-1, 2)

    def __call__(self, road: Int64, station: Float64) -> tuple[Float64, Float64, Float64, Float64]:
        """(N,) x, y, heading, curvature at stations; beyond a piece's end its end."""
        index = self._breaks.find(road, station)
        begin, length, x, y, heading = self._table[index].T
        local = self._local(index, np.clip(station - begin, 0.0, length))
        c, s = np.cos(heading), np.sin(heading)
        return (
            x + c * local.u - s * local.v,
            y + s * local.u + c * local.v,
            heading + local.heading,
            local.curvature,
        )

    def _local(self, index: Int64, d: Float64) -> Local:
        out = Local(d.copy(), np.zeros_like(d), np.zeros_like(d), np.zeros_like(d))
        shape = self._shape[index]
        start, end = self._curvatures[index].T
        for name, evaluate in (("arc", _arc), ("spiral", _spiral)):
            here = np.flatnonzero(shape == GEOMETRY_SHAPES.index(name))
            length = self._table[index[here], 1]
            _put(out, here, evaluate(d[here], start[here], end[here], length))
        polynomial = np.isin(shape, [GEOMETRY_SHAPES.index(n) for n in ("poly3", "paramPoly3")])
        for piece in np.unique(index[polynomial]):
            here = np.flatnonzero(index == piece)
            _put(out, here, polynomial_curve(self._pieces[piece], d[here]))
        return out


def _put(out: Local, where: Int64, values: Local) -> None:
    for target, source in zip(out, values, strict=True):
        target[where] = source


def _curvatures(piece: GeometryRecord) -> tuple[float, float]:
    if piece.shape == "arc":
        return piece.parameters[0], piece.parameters[0]
    if piece.shape == "spiral":
        return piece.parameters[0], piece.parameters[1]
    return 0.0, 0.0


def _arc(d: Float64, curvature: Float64, _end: Float64, _length: Float64) -> Local:
    flat = np.abs(curvature) < _STRAIGHT
    k = np.where(flat, 1.0, curvature)
    angle = k * d
    u = np.where(flat, d, np.sin(angle) / k)
    v = np.where(flat, 0.0, 2.0 * np.sin(0.5 * angle) ** 2 / k)
    return Local(u, v, np.where(flat, 0.0, angle), np.where(flat, 0.0, k))


def _spiral(d: Float64, start: Float64, end: Float64, length: Float64) -> Local:
    """A clothoid: curvature changes linearly, so heading is a parabola; u, v by quadrature."""
    rate = (end - start) / np.where(length > 0.0, length, 1.0)
    along = 0.5 * d[:, None] * (_NODES + 1.0)  # (N, nodes)
    heading = along * (start[:, None] + 0.5 * rate[:, None] * along)
    half = 0.5 * d
    return Local(
        half * (np.cos(heading) @ _WEIGHTS),
        half * (np.sin(heading) @ _WEIGHTS),
        d * (start + 0.5 * rate * d),
        start + rate * d,
    )


def polynomial_curve(piece: GeometryRecord, d: Float64) -> Local:
    """poly3 (v over u) and paramPoly3 (u and v over p), by a table of arc length over parameter.

    A paramPoly3's whole parameter range is spread over the piece's length, so that it ends where
    the next piece begins even if its length is a little off.
    """
    if piece.shape == "poly3":
        u, v = np.array([0.0, 1.0, 0.0, 0.0]), np.array(piece.parameters)
        last = piece.length
    else:
        u, v = np.array(piece.parameters[:4]), np.array(piece.parameters[4:8])
        last = piece.length if piece.parameters[8] else 1.0
    table = np.linspace(0.0, last, _TABLE_STEPS + 1)
    middle = 0.5 * (table[1:] + table[:-1])
    step = np.hypot(_slope(u, middle), _slope(v, middle)) * np.diff(table)
    arc = np.concatenate([[0.0], np.cumsum(step)])
    scale = arc[-1] / piece.length if piece.shape == "paramPoly3" and piece.length > 0.0 else 1.0
    p = np.interp(d * scale, arc, table)
    du, dv = _slope(u, p), _slope(v, p)
    bend = du * _second(v, p) - dv * _second(u, p)
    speed = np.hypot(du, dv)
    curvature = bend / np.where(speed > 0.0, speed, 1.0) ** 3
    return Local(_value(u, p), _value(v, p), np.arctan2(dv, du), curvature)


def _value(c: Float64, p: Float64) -> Float64:
    value: Float64 = c[0] + p * (c[1] + p * (c[2] + p * c[3]))
    return value


def _slope(c: Float64, p: Float64) -> Float64:
    slope: Float64 = c[1] + p * (2.0 * c[2] + 3.0 * p * c[3])
    return slope


def _second(c: Float64, p: Float64) -> Float64:
    second: Float64 = 2.0 * c[2] + 6.0 * p * c[3]
    return second
