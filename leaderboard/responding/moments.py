"""Which moments of a drive are worth marking: the paper marks three of each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from leaderboard.responding.drive_responses import DriveResponses, plain_words

MARKED = 3
_APART_S = 2.0
_BEFORE_S = 1.0  # when what went wrong was being decided
_FIRST = ("turning", "obstacle", "light", "junction", "stop_sign", "free")


def marked_moments(drive: DriveResponses, at_s: Sequence[float] = ()) -> tuple[int, ...]:
    """Indices of the moments to mark, in the order of time.

    Args:
        drive: The drive.
        at_s: Game times that are wanted; the moments nearest to them are taken. Without any, a
            second before the first infraction, then the middle of the longest stretch of each
            situation, until there are three.
    """
    if at_s:
        return tuple(sorted({int(np.abs(drive.time_s - time).argmin()) for time in at_s}))
    chosen: list[int] = []
    for moment in _candidates(drive):
        apart = (abs(drive.time_s[moment] - drive.time_s[other]) for other in chosen)
        if len(chosen) < MARKED and all(gap >= _APART_S for gap in apart):
            chosen.append(moment)
    return tuple(sorted(chosen)) or (len(drive.time_s) // 2,)


def _candidates(drive: DriveResponses) -> Iterator[int]:
    for time_s, _ in drive.events[:1]:
        yield int(np.abs(drive.time_s - (time_s - _BEFORE_S)).argmin())
    for situation in _FIRST:
        middle = _middle(drive.holding(situation))
        if middle is not None:
            yield middle


def stretches(holds: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and one after the last of each unbroken stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(np.int8)))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def moment_name(drive: DriveResponses, index: int) -> str:
    """`t = 12.5 s (turning, junction)`."""
    holds = [
        plain_words(name)
        for name, held in zip(drive.situations, drive.holds[index], strict=True)
        if held
    ]
    return f"t = {drive.time_s[index]:.1f} s ({', '.join(holds) or 'between situations'})"


def _middle(holds: NDArray[np.bool_]) -> int | None:
    found = stretches(holds)
    if not found:
        return None
    first, last = max(found, key=lambda stretch: stretch[1] - stretch[0])
    return (first + last - 1) // 2
