"""Signal heads and their stop lines, from wherever they are told: the map, a sidecar, a guess.

Who finds them gives `Head`s; what the world needs of them is derived here, by one rule for all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import Lanes, SignalKind, Signals
from di_envs.town.reading.arms import Arm, make_arm, pole_place, stop_width

BOX_HALF_LENGTH_M = 2.0  # a trigger box covers the last 4 m before the stop line
SIGN_REACH_M = 12.0  # a sign further from its lanes than this is not stretched a box for


@dataclass(frozen=True, kw_only=True)
class Head:
    """A signal head before it is placed."""

    kind: SignalKind
    junction: int
    lanes: tuple[int, ...]  # approach lanes that it rules
    turn: tuple[int, ...] = ()  # lights of equal turn are green together; sorted by it
    # x, y, z of the pole's foot; None: at the outer edge of the road
    foot: tuple[float, float, float] | None = None


def assemble_signals(
    lanes: Lanes, heads: list[Head], junctions: int
) -> tuple[Signals, NDArray[np.int32]]:
    """Places heads and makes their stop lines.

    A stop line is the end of an approach lane, where the Leaderboard has it too: it takes the last
    point before the junction. It belongs to one head: to a light before a sign, else to the first.

    Returns:
        The signals, and `Lanes.stop_line`.
    """
    arms = [make_arm(lanes, head.junction, list(head.lanes)) for head in heads]
    poses = [_pose(lanes, head, arm) for head, arm in zip(heads, arms, strict=True)]
    boxes = [_box(*row) for row in zip(heads, arms, poses, strict=True)]
    groups, group_counts = _groups(heads, junctions)
    stop_line = np.full(len(lanes.kind), -1, dtype=np.int32)
    owner: dict[int, int] = {}
    for index in sorted(range(len(heads)), key=lambda i: (heads[i].kind, i)):
        for lane in heads[index].lanes:
            owner.setdefault(lane, index)
    ruled = sorted(owner, key=lambda lane: (owner[lane], lane))
    stop_line[ruled] = np.arange(len(ruled))
    last = lanes.first[ruled] + lanes.count[ruled] - 1 if ruled else np.zeros(0, dtype=np.int64)
    stop_pose = lanes.points[last].copy()
    stop_pose[:, 3] = (stop_pose[:, 3] + np.pi) % (2.0 * np.pi) - np.pi
    signals = Signals(
        kind=np.array([head.kind for head in heads], dtype=np.int8),
        junction=np.array([head.junction for head in heads], dtype=np.int32),
        group=np.array(groups, dtype=np.int32),
        pose=np.array(poses, dtype=np.float64).reshape(-1, 4),
        box=np.array(boxes, dtype=np.float64).reshape(-1, 6),
        stop_signal=np.array([owner[lane] for lane in ruled], dtype=np.int32),
        stop_lane=np.array(ruled, dtype=np.int32),
        stop_pose=stop_pose,
        stop_width_m=np.array([stop_width(lanes, lane) for lane in ruled], dtype=np.float64),
        groups=group_counts,
    )
    return signals, stop_line


def heads_of_arms(arms: list[Arm], kinds: list[SignalKind | None]) -> list[Head]:
    """A head for each arm that has a kind; lights take turns in the arms' order."""
    return [
        Head(kind=kind, junction=arm.junction, lanes=arm.lanes, turn=(number,))
        for number, (arm, kind) in enumerate(zip(arms, kinds, strict=True))
        if kind is not None
    ]


def ordered(heads: list[Head]) -> list[Head]:
    """Heads by junction, then turn; those of a junction without turns as they come."""
    return sorted(heads, key=lambda head: (head.junction, head.turn))


def _groups(heads: list[Head], junctions: int) -> tuple[list[int], NDArray[np.int32]]:
    counts = np.zeros(junctions, dtype=np.int32)
    turns: dict[int, list[tuple[int, ...]]] = {}
    for head in heads:
        if head.kind == SignalKind.LIGHT:
            turns.setdefault(head.junction, []).append(head.turn)
    order = {junction: sorted(set(own)) for junction, own in turns.items()}
    for junction, own in order.items():
        counts[junction] = len(own)
    groups = [
        order[head.junction].index(head.turn) if head.kind == SignalKind.LIGHT else -1
        for head in heads
    ]
    return groups, counts


def _pose(lanes: Lanes, head: Head, arm: Arm) -> NDArray[np.float64]:
    if head.foot is not None:
        return np.array([*head.foot, arm.end[3]], dtype=np.float64)
    ahead = 0.0 if head.kind == SignalKind.LIGHT else -BOX_HALF_LENGTH_M
    return arm.place(*pole_place(lanes, arm, ahead))


def _box(head: Head, arm: Arm, pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """The trigger box: the last metres of the approach lanes, before the stop line.

    Leaderboard 1.0 fines a stop sign only if the ego's centre had been in a box of the same size
    around the sign's own place. So a sign's box is centred as far aside as the sign stands and wide
    enough to cover, from there too, all its lanes. What other lanes it covers does not matter: a
    sign is for those on lanes that it rules (`di_envs.world.events.stop_sign`).
    """
    right, half_width = 0.0, arm.half_width_m
    if head.kind != SignalKind.LIGHT:
        _, pole = arm.ahead_right(pose[0], pose[1])
        if abs(pole) <= SIGN_REACH_M:
            half_width, right = abs(pole) + arm.half_width_m, pole
    middle = arm.place(-BOX_HALF_LENGTH_M, right)
    return np.append(middle, [BOX_HALF_LENGTH_M, half_width])
