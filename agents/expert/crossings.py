"""Whom the expert may meet at junctions: the ways that cross its path, from the map alone.

A stream is one way through a junction with the lanes that lead up to it. Where several lanes lead
up to a way, there is a stream for each. Others are looked for on streams by where they are and how
they head, as nobody says which way he will choose. World frame; a stream's stations begin where its
way does: those before it are negative.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agents.expert.path import DrivePath
from di_envs.numerics.arrays import Float64, Int8, Int32
from di_envs.numerics.bundles import by_reference
from di_envs.town.lanes import Lanes, SignalKind, Signals, Turn
from di_envs.town.town import Town

BACK_M = 45.0  # before a junction, from which on those who come are looked at
MOST_STREAMS = 4  # to one way
POINT_M = 1.0  # between points of a stream


@by_reference
class Crossings(NamedTuple):
    """Places where a path is crossed (M), and the streams that do so (W, of N points in all)."""

    own_rank: Int8  # (G,) of the path's legs: who has the smaller one goes first
    # (M,) sorted by leg, then by stream
    meet_start: Int32  # (G + 1,) those of the junction that begins with leg g are [g], [g + 1])
    stream: Int32
    begin_m: Float64  # stations of the path
    end_m: Float64
    other_begin_m: Float64  # stations of the stream
    other_end_m: Float64
    # (W,)
    first: Int32  # first point
    points: Int32  # how many
    back_m: Float64  # from the first point to the junction
    turn: Int8  # Turn
    rank: Int8
    light: Int32  # signal of the light that governs it, -1 for none
    sign: Int8  # 1 where a sign does
    # (N,)
    x: Float64
    y: Float64
    z: Float64
    yaw: Float64


class _Builder:
    """Collects streams, each way's once."""

    def __init__(self, town: Town) -> None:
        self.lanes, self.signals = town.lanes, town.signals
        self.of_way: dict[int, list[int]] = {}
        self.rows: list[tuple[int, int, float, int, int, int, int]] = []
        self.pieces: list[Float64] = []
        self.size = 0

    def streams(self, way: int) -> list[int]:
        """The streams of a way."""
        if way not in self.of_way:
            chains = _chains(self.lanes, way)
            self.of_way[way] = [self._add(chain) for chain in chains]
        return self.of_way[way]

    def _add(self, chain: list[int]) -> int:
        """A stream along lanes of which the last is its way."""
        lanes, way = self.lanes, chain[-1]
        back_m = float(lanes.length_m[chain[:-1]].sum())
        points = _points_along(lanes, chain)
        skip = max(int((back_m - BACK_M) / POINT_M), 0)
        points, back_m = points[skip:], back_m - skip * POINT_M
        signal, kind = _signal_at(lanes, self.signals, chain[-2] if len(chain) > 1 else -1)
        light = signal if kind == SignalKind.LIGHT else -1
        sign = int(signal >= 0 and light < 0)
        turn, rank = int(lanes.turn[way]), _rank(lanes, way, kind)
        self.rows.append((self.size, len(points), back_m, turn, rank, light, sign))
        self.pieces.append(points)
        self.size += len(points)
        return len(self.rows) - 1


def crossings_of(path: DrivePath, town: Town) -> Crossings:
    """Where others may cross a path, and on which ways they come."""
    builder = _Builder(town)
    meets: list[tuple[int, int, float, float, float, float]] = []
    first = 0
    for leg, junction in enumerate(path.leg_junction):
        if junction < 0 or leg == 0 or path.leg_junction[leg - 1] != junction:
            first = leg
        _add_meets(meets, builder, path, leg, first)
    meets.sort(key=lambda row: (row[0], row[1]))
    legs = np.array([row[0] for row in meets], np.int32)
    start = np.searchsorted(legs, np.arange(path.leg_lane.size + 1)).astype(np.int32)
    columns = list(zip(*meets, strict=True)) or [()] * 6
    streams = list(zip(*builder.rows, strict=True)) or [()] * 7
    points = np.concatenate([np.zeros((0, 4)), *builder.pieces])
    crossings = Crossings(
        own_rank=_own_ranks(path, town),
        meet_start=start,
        stream=np.array(columns[1], np.int32),
        begin_m=np.array(columns[2], np.float64),
        end_m=np.array(columns[3], np.float64),
        other_begin_m=np.array(columns[4], np.float64),
        other_end_m=np.array(columns[5], np.float64),
        first=np.array(streams[0], np.int32),
        points=np.array(streams[1], np.int32),
        back_m=np.array(streams[2], np.float64),
        turn=np.array(streams[3], np.int8),
        rank=np.array(streams[4], np.int8),
        light=np.array(streams[5], np.int32),
        sign=np.array(streams[6], np.int8),
        x=points[:, 0].copy(),
        y=points[:, 1].copy(),
        z=points[:, 2].copy(),
        yaw=points[:, 3].copy(),
    )
    for array in crossings:
        array.flags.writeable = False
    return crossings


def _add_meets(
    meets: list[tuple[int, int, float, float, float, float]],
    builder: _Builder,
    path: DrivePath,
    leg: int,
    first: int,
) -> None:
    """Adds the places where a leg of a junction, whose first leg is `first`, is crossed."""
    lanes, lane, offset = builder.lanes, int(path.leg_lane[leg]), float(path.leg_offset_m[leg])
    for k in range(lanes.conflict_start[lane], lanes.conflict_start[lane + 1]):
        other = int(lanes.conflict_lane[k])
        if _before(lanes, lane) & _before(lanes, other):
            continue  # they part from the path's own lane: leaders or followers
        place = (float(lanes.conflict_begin_m[k]) + offset, float(lanes.conflict_end_m[k]) + offset)
        theirs = float(lanes.conflict_other_begin_m[k]), float(lanes.conflict_other_end_m[k])
        meets.extend((first, stream, *place, *theirs) for stream in builder.streams(other))


def _before(lanes: Lanes, lane: int) -> set[int]:
    """The lanes that lead up to one."""
    span = slice(lanes.predecessor_start[lane], lanes.predecessor_start[lane + 1])
    return {int(other) for other in lanes.predecessor[span]}


def _chains(lanes: Lanes, way: int) -> list[list[int]]:
    """Chains of lanes that lead up to a way and end with it, `BACK_M` long where they can be."""
    done: list[list[int]] = []
    growing = [[way]]
    while growing and len(done) + len(growing) <= MOST_STREAMS:
        chain = growing.pop(0)
        before = sorted(_before(lanes, chain[0]) - set(chain))
        if float(lanes.length_m[chain[:-1]].sum()) >= BACK_M or not before:
            done.append(chain)
        else:
            growing.extend([other, *chain] for other in before)
    return (done + growing)[:MOST_STREAMS]


def _points_along(lanes: Lanes, chain: list[int]) -> Float64:
    """(N, 4) points at `POINT_M` along linked lanes."""
    pieces = [lanes.points[lanes.first[a] : lanes.first[a] + lanes.count[a]] for a in chain]
    stations, begin = [], 0.0
    for lane in chain:
        stations.append(begin + np.arange(lanes.count[lane]) * float(lanes.spacing_m[lane]))
        begin += float(lanes.length_m[lane])
    points, station = np.concatenate(pieces), np.concatenate(stations)
    yaw = np.unwrap(points[:, 3])
    wanted = np.arange(0.0, begin + 0.5 * POINT_M, POINT_M)
    columns = (points[:, 0], points[:, 1], points[:, 2], yaw)
    return np.stack([np.interp(wanted, station, column) for column in columns], axis=1)


def _signal_at(lanes: Lanes, signals: Signals, approach: int) -> tuple[int, int]:
    """(signal, its kind) at the end of a lane; -1, 0 where there is none."""
    line = int(lanes.stop_line[approach]) if approach >= 0 else -1
    if line < 0:
        return -1, 0
    signal = int(signals.stop_signal[line])
    return signal, int(signals.kind[signal])


def _rank(lanes: Lanes, way: int, kind: int) -> int:
    """0 goes before 1, who turns left across others, and he before 2, who has a sign."""
    if kind not in (0, int(SignalKind.LIGHT)):
        return 2
    return int(lanes.turn[way] == Turn.LEFT)


def _own_ranks(path: DrivePath, town: Town) -> Int8:
    """The path's own rank on each of its legs; 0 outside junctions."""
    ranks = np.zeros(path.leg_lane.size, np.int8)
    for leg in range(1, ranks.size):
        if path.leg_junction[leg] >= 0:
            _, kind = _signal_at(town.lanes, town.signals, int(path.leg_lane[leg - 1]))
            ranks[leg] = _rank(town.lanes, int(path.leg_lane[leg]), kind)
    return ranks
