"""What traffic and people on foot look up of crosswalks: their strips, their lights, who comes.

All are arrays of `WalkGraph`, which says what each of them holds.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import Crosswalks, Lanes, SignalKind, Signals

LOOK_BACK_M = 80.0  # up to which vehicles ahead of a crosswalk are looked at
STOP_LINE_M = 25.0  # from a crosswalk, within which a stop line guards it


def strips(crosswalks: Crosswalks) -> NDArray[np.float64]:
    """(X, 6) of each crosswalk: centre x, y, z, yaw along it, half its length, half its width."""
    along = crosswalks.end - crosswalks.start
    return np.column_stack(
        (
            0.5 * (crosswalks.start + crosswalks.end),
            np.arctan2(along[:, 1], along[:, 0]),
            0.5 * np.hypot(along[:, 0], along[:, 1]),
            0.5 * crosswalks.width_m,
        )
    )


def lights_of(lanes: Lanes, crosswalks: Crosswalks, signals: Signals) -> dict[str, Any]:
    """The lights at the stop lines before which, or shortly after which, a crosswalk lies."""
    starts, lights = [0], []
    for crosswalk in range(crosswalks.width_m.size):
        found = set()
        for k in range(
            crosswalks.crossed_start[crosswalk], crosswalks.crossed_start[crosswalk + 1]
        ):
            lane = int(crosswalks.crossed_lane[k])
            guarded = []
            if lanes.length_m[lane] - crosswalks.crossed_end_m[k] <= STOP_LINE_M:
                guarded.append(lane)
            if (
                lanes.junction[lane] >= 0
                and crosswalks.crossed_begin_m[k] <= 0.5 * lanes.length_m[lane]
            ):
                guarded += _linked(lanes.predecessor_start, lanes.predecessor, lane)
            lines = [int(lanes.stop_line[lane]) for lane in guarded if lanes.stop_line[lane] >= 0]
            heads = [int(signals.stop_signal[line]) for line in lines]
            found |= {head for head in heads if signals.kind[head] == SignalKind.LIGHT}
        lights += sorted(found)
        starts.append(len(lights))
    return {"light_start": np.array(starts, np.int32), "light": np.array(lights, np.int32)}


def _linked(start: NDArray[np.int32], links: NDArray[np.int32], lane: int) -> list[int]:
    return [int(other) for other in links[start[lane] : start[lane + 1]]]


def approaches(lanes: Lanes, crosswalks: Crosswalks) -> dict[str, Any]:
    """For each lane the crosswalks ahead, found by walking back from them."""
    rows: list[list[tuple[int, int, float, float]]] = [[] for _ in range(lanes.kind.size)]
    for crosswalk in range(crosswalks.width_m.size):
        for k in range(
            crosswalks.crossed_start[crosswalk], crosswalks.crossed_start[crosswalk + 1]
        ):
            crossed = int(crosswalks.crossed_lane[k])
            depth = float(crosswalks.crossed_end_m[k] - crosswalks.crossed_begin_m[k])
            begin = {crossed: float(crosswalks.crossed_begin_m[k])}
            front = [crossed]
            while front:
                lane = front.pop(0)
                rows[lane].append((crosswalk, crossed, begin[lane], begin[lane] + depth))
                for before in _linked(lanes.predecessor_start, lanes.predecessor, lane):
                    if begin[lane] < LOOK_BACK_M and before not in begin:
                        begin[before] = begin[lane] + float(lanes.length_m[before])
                        front.append(before)
    flat = [row for own in rows for row in own]
    leading: list[list[int]] = [[] for _ in range(crosswalks.width_m.size)]
    for lane, own in enumerate(rows):
        for crosswalk in sorted({row[0] for row in own}):
            leading[crosswalk].append(lane)
    return {
        "approach_start": np.cumsum([0, *(len(own) for own in rows)]).astype(np.int32),
        "approach": np.array([row[0] for row in flat], np.int32),
        "approach_lane": np.array([row[1] for row in flat], np.int32),
        "approach_begin_m": np.array([row[2] for row in flat], np.float64),
        "approach_end_m": np.array([row[3] for row in flat], np.float64),
        "leading_start": np.cumsum([0, *(len(lanes) for lanes in leading)]).astype(np.int32),
        "leading": np.array([lane for lanes in leading for lane in lanes], np.int32),
    }
