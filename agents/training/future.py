"""What will be around the ego, as it sees it now: labels of those that predict."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from agents.training.frames import DriveStage, RecordedDrive
from agents.zoo.raster import true_raster
from di_envs.world.kinds import ActorKind
from di_envs.world.world import WorldView


def later_views(
    drive: RecordedDrive, moment: int, view: WorldView, count: int
) -> Iterator[WorldView]:
    """The moments that follow, with the ego left where it is now; the last one stays at the end.

    Args:
        drive: The drive.
        moment: The present one.
        view: Of the present, with the ego set aside as it may be.
        count: How many.

    Yields:
        Views that are good until the next is asked for.
    """
    later = DriveStage(view.town, view.plans[0], drive.capacity)
    for step in range(1, count + 1):
        later.set(drive, min(moment + step, len(drive) - 1))
        for name in ("x", "y", "z", "yaw"):
            getattr(later.view.state, name)[0] = getattr(view.state, name)[0]
        yield later.view


def later_rasters(
    drive: RecordedDrive, moment: int, view: WorldView, routing: NDArray[np.floating], count: int
) -> NDArray[np.float16]:
    """(count, C, X, Y) the true views from above; arguments as for `later_views` and its raster."""
    views = later_views(drive, moment, view, count)
    return np.stack([true_raster(each, routing) for each in views]).astype(np.float16)


def later_places(
    drive: RecordedDrive,
    moment: int,
    view: WorldView,
    objects: NDArray[np.floating],
    count: int,
) -> NDArray[np.float32]:
    """Where others will be.

    Args:
        drive: As for `later_views`.
        moment: Likewise.
        view: Likewise.
        objects: (N, 9) rows of `driveinsight.seen` of the present, zeros for none.
        count: How many moments.

    Returns:
        (N, count, 3) x, y in the ego's present frame [m], and 1 where that is known.
    """
    out = np.zeros((len(objects), count, 3), np.float32)
    rows = np.flatnonzero(objects[:, -1] != 0.0)
    away = _seen_by_ego(view, view)[None] - objects[rows, None, :2]  # (N', A, 2)
    away[:, (view.state.kind == ActorKind.ABSENT) | (view.state.kind >= ActorKind.PROP)] = np.inf
    away[:, 0] = np.inf
    actors = np.square(away).sum(axis=2).argmin(axis=1)  # who each row is of
    for step, later in enumerate(later_views(drive, moment, view, count)):
        known = moment + 1 + step < len(drive)
        out[rows, step, :2] = _seen_by_ego(later, view)[actors]
        out[rows, step, 2] = known & (later.state.kind[actors] != ActorKind.ABSENT)
    return out


def _seen_by_ego(view: WorldView, now: WorldView) -> NDArray[np.float64]:
    """(A, 2) x, y of all actors in the frame of the ego of another view."""
    own, state = now.state, view.state
    dx, dy, yaw = state.x - own.x[0], state.y - own.y[0], own.yaw[0]
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.stack([cos * dx + sin * dy, cos * dy - sin * dx], axis=1)
