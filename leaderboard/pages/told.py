"""What an agent is told by its prompt, moment by moment, as columns that a page can hold.

Tables are packed without their empty rows, in the ego's frame as the agent has them. The map's
polylines are put in the world's frame, where the same ones come again from moment to moment, so
that each is written once and a moment only names those it has.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from leaderboard.records.blocks import Column
from leaderboard.replaying.film import ANGLE_STEP, METRE_STEP, SPEED_STEP

_SAME_M = 0.1  # polylines that agree to this are one
_ASIDE_M = 0.0371  # towns are drawn in round numbers: none of them shall lie where rounding turns
_FLAG = 1.0
# Columns of the tables but for `valid`, and their steps
_TABLES: Mapping[str, Mapping[str, float]] = {
    "routing": {"x": METRE_STEP, "y": METRE_STEP},
    "obstacles": {
        "x": METRE_STEP,
        "y": METRE_STEP,
        "yaw": ANGLE_STEP,
        "length": METRE_STEP,
        "width": METRE_STEP,
        "vx": SPEED_STEP,
        "vy": SPEED_STEP,
        "kind": _FLAG,
    },
    "traffic_lights": {"x": METRE_STEP, "y": METRE_STEP, "yaw": ANGLE_STEP, "state": _FLAG},
    "stop_signs": {"x": METRE_STEP, "y": METRE_STEP, "yaw": ANGLE_STEP},
}


def told_columns(seen: Mapping[str, NDArray[Any]], poses: NDArray[np.float64]) -> dict[str, Column]:
    """The columns of what was told at N moments.

    Args:
        seen: Component to (N, ...) as in the observation, and `prompt_present`.
        poses: (N, 3) x, y, yaw of the ego then, world frame.
    """
    columns: dict[str, Column] = {}
    for table, parts in _TABLES.items():
        columns |= _table(table, np.asarray(seen[table], np.float64), parts)
    target = np.asarray(seen["target_point"], np.float64)
    for index, (name, step) in enumerate(
        (("x", METRE_STEP), ("y", METRE_STEP), ("yaw", ANGLE_STEP))
    ):
        columns[f"target_{name}"] = Column(values=target[:, index], step=step)
    columns["command"] = Column(values=seen["command"])
    columns["speed"] = Column(values=seen["speed"], step=SPEED_STEP)
    columns["present"] = Column(values=seen["prompt_present"], differences=0)
    return columns | _map(np.asarray(seen["map"], np.float64), poses)


def _table(name: str, rows: NDArray[np.float64], parts: Mapping[str, float]) -> dict[str, Column]:
    """How many valid rows each moment has, and all of them one after the other."""
    valid = rows[..., -1] > 0.0
    columns = {f"{name}_count": Column(values=valid.sum(axis=1))}
    for index, (part, step) in enumerate(parts.items()):
        columns[f"{name}_{part}"] = Column(values=rows[..., index][valid], step=step)
    return columns


def _map(lines: NDArray[np.float64], poses: NDArray[np.float64]) -> dict[str, Column]:
    """Each polyline once, in the world's frame, and which of them each moment has."""
    known: dict[bytes, int] = {}
    points: list[NDArray[np.float64]] = []
    kinds: list[int] = []
    counts, names = [], []
    for moment, (x, y, yaw) in zip(lines, poses, strict=True):
        turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
        there = 0
        for line in moment:
            told = line[line[:, 3] > 0.0]
            if not len(told):
                continue
            world = told[:, :2] @ turn + (x, y)
            key = np.rint((world + _ASIDE_M) / _SAME_M).astype(np.int32).tobytes() + bytes(
                [int(told[0, 2])]
            )
            if key not in known:
                known[key] = len(points)
                points.append(world)
                kinds.append(int(told[0, 2]))
            names.append(known[key])
            there += 1
        counts.append(there)
    all_points = np.concatenate(points) if points else np.zeros((0, 2))
    return {
        "map_count": Column(values=counts),
        "map_line": Column(values=names),
        "line_kind": Column(values=kinds),
        "line_count": Column(values=[len(line) for line in points]),
        "line_x": Column(values=all_points[:, 0], step=METRE_STEP),
        "line_y": Column(values=all_points[:, 1], step=METRE_STEP),
    }
