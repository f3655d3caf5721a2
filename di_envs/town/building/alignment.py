"""Plan curves as lines and arcs: what a road's centre line is made of.

Only lines and arcs are used, since every OpenDRIVE reader agrees on them (CARLA's gives NaN for
some spirals). Frame: OpenDRIVE's, x east, y north [m], headings counter-clockwise [rad].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

_STRAIGHT_PER_M = 1e-7  # a flatter arc is a line
_SWERVE_RAD = math.radians(30.0)  # below this a curve between two poses is an S or a flat bow


class Pose(NamedTuple):
    """A point and a heading."""

    x: float
    y: float
    heading: float

    def shifted(self, ahead_m: float, left_m: float) -> Pose:
        """The pose that is `ahead_m` in front and `left_m` to the left, with the same heading."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return Pose(
            self.x + c * ahead_m - s * left_m, self.y + s * ahead_m + c * left_m, self.heading
        )

    def local(self, x: float, y: float) -> tuple[float, float]:
        """A point in this pose's frame: (ahead, left) [m]."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return c * (x - self.x) + s * (y - self.y), c * (y - self.y) - s * (x - self.x)

    def reversed(self) -> Pose:
        """The same place, seen the other way."""
        return Pose(self.x, self.y, wrapped(self.heading + math.pi))


class CurvePiece(NamedTuple):
    """A line (curvature 0) or an arc (curvature positive to the left)."""

    start: Pose
    length_m: float
    curvature_per_m: float

    def at(self, ahead_m: float) -> Pose:
        """The pose after `ahead_m` along the piece."""
        turned = ahead_m * self.curvature_per_m
        if self.curvature_per_m == 0.0:
            return self.start.shifted(ahead_m, 0.0)
        radius = 1.0 / self.curvature_per_m
        moved = self.start.shifted(radius * math.sin(turned), radius * (1.0 - math.cos(turned)))
        return Pose(moved.x, moved.y, moved.heading + turned)

    @property
    def end(self) -> Pose:
        """The last pose."""
        return self.at(self.length_m)


Curve = tuple[CurvePiece, ...]


def wrapped(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def length_of(curve: Curve) -> float:
    """Length of all pieces together [m]."""
    return sum(piece.length_m for piece in curve)


def pose_at(curve: Curve, station_m: float) -> Pose:
    """The pose at a station of a curve; stations beyond its ends give its ends."""
    left = max(station_m, 0.0)
    for piece in curve:
        if left <= piece.length_m:
            return piece.at(left)
        left -= piece.length_m
    return curve[-1].end


def rounded_polyline(points: Sequence[tuple[float, float, float]]) -> Curve:
    """Joins points by lines and rounds each inner corner by an arc.

    Args:
        points: x, y, corner radius [m]; the radius of the first and the last is not used.

    Returns:
        The curve from the first to the last point.

    Raises:
        ValueError: If two roundings overlap, naming the corner.
    """
    pieces: list[CurvePiece] = []
    x, y, _ = points[0]
    for index in range(1, len(points)):
        corner_x, corner_y, radius = points[index]
        heading = math.atan2(corner_y - y, corner_x - x)
        leg = math.hypot(corner_x - x, corner_y - y)
        turn, cut = 0.0, 0.0
        if index + 1 < len(points):
            after = points[index + 1]
            turn = wrapped(math.atan2(after[1] - corner_y, after[0] - corner_x) - heading)
            cut = radius * math.tan(abs(turn) / 2.0)
        if cut > leg:
            raise ValueError(
                f"the rounding of corner {index} at ({corner_x:g}, {corner_y:g}) needs {cut:.1f} m "
                f"of a leg of {leg:.1f} m; choose a smaller radius or move the corner"
            )
        pieces.append(CurvePiece(Pose(x, y, heading), leg - cut, 0.0))
        if turn != 0.0:
            pieces.append(
                CurvePiece(pieces[-1].end, radius * abs(turn), math.copysign(1.0 / radius, turn))
            )
        x, y, _ = pieces[-1].end
    return tuple(piece for piece in pieces if piece.length_m > 1e-6)


def curve_between(start: Pose, end: Pose) -> Curve:
    """A smooth curve that leaves `start` and arrives at `end` with their headings.

    A turn is one arc of the largest possible radius, with a line before or after it; an almost
    straight way is two arcs (a biarc), as its ends may be offset sideways.

    Raises:
        ValueError: If a turn's arc is impossible since the corner lies behind one of its ends.
    """
    turn = wrapped(end.heading - start.heading)
    if abs(turn) < _SWERVE_RAD:
        return _biarc(start, end)
    ahead, left = start.local(end.x, end.y)
    before = ahead - left / math.tan(turn)  # from start to the corner of the two tangents
    after = left / math.sin(turn)  # from that corner to the end
    shorter = min(before, after)
    if shorter <= 0.0:
        raise ValueError(
            f"no turn from ({start.x:.1f}, {start.y:.1f}) to ({end.x:.1f}, {end.y:.1f}): the "
            f"tangents meet {before:.2f} m after the start and {after:.2f} m before the end"
        )
    radius = shorter / math.tan(abs(turn) / 2.0)
    line_in = CurvePiece(start, before - shorter, 0.0)
    arc = CurvePiece(line_in.end, radius * abs(turn), math.copysign(1.0 / radius, turn))
    line_out = CurvePiece(arc.end, after - shorter, 0.0)
    return tuple(piece for piece in (line_in, arc, line_out) if piece.length_m > 1e-6)


def _biarc(start: Pose, end: Pose) -> Curve:
    """Two arcs with tangents of one length.

    Source: Bolton: Biarc curves, Computer-Aided Design 1975.
    """
    sx, sy = math.cos(start.heading), math.sin(start.heading)
    ex, ey = math.cos(end.heading), math.sin(end.heading)
    vx, vy = end.x - start.x, end.y - start.y
    along = vx * (sx + ex) + vy * (sy + ey)
    bend = 2.0 * (1.0 - (sx * ex + sy * ey))
    square = vx * vx + vy * vy
    reach = square / (along + math.sqrt(along * along + bend * square))
    middle_x = 0.5 * (start.x + end.x + reach * (sx - ex))
    middle_y = 0.5 * (start.y + end.y + reach * (sy - ey))
    first = _arc_to(start, middle_x, middle_y)
    return first, _arc_to(first.end, end.x, end.y)


def _arc_to(start: Pose, x: float, y: float) -> CurvePiece:
    """The arc that leaves `start` with its heading and passes through a point."""
    chord = math.hypot(x - start.x, y - start.y)
    half_turn = wrapped(math.atan2(y - start.y, x - start.x) - start.heading)
    curvature = 2.0 * math.sin(half_turn) / chord
    if abs(curvature) < _STRAIGHT_PER_M:
        return CurvePiece(start, chord, 0.0)
    return CurvePiece(start, 2.0 * half_turn / curvature, curvature)
