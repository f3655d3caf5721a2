"""What a system of the zoo is to say, at a moment of a drive: a table of labels, by name.

A system names the labels that it learns from (`SystemConfig.labels`); waypoints every one has.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from agents.driveinsight.seen import OBJECT_COLUMNS, SIGNAL_COLUMNS
from agents.training.bev_teacher import bev_semantics
from agents.training.frames import DriveStage, RecordedDrive
from agents.training.future import later_places, later_rasters
from agents.training.samples import Known, foreseeable
from agents.training.truth import seen_truth
from agents.training.waypoints import expert_waypoints
from agents.zoo.raster import GRID, true_raster
from agents.zoo.system import SystemConfig
from di_envs.actions.controllers import (
    ControllerMemory,
    WaypointControllerConfig,
    waypoints_to_control,
)

OBJECTS = 48  # that are told, the nearest first
_FOLLOWING = WaypointControllerConfig()


@dataclass(frozen=True, kw_only=True)
class LabelledMoment:
    """What labels are made from.

    Attributes:
        drive: Of which it is a moment.
        moment: Which.
        stage: That shows it, with the ego set aside.
        observation: Of that ego.
        waypoints: (T, 2) where the expert went, as that ego sees it [m].
        valid: (T,) 0 or 1: where that is known.
        known: (T,) 0 or 1: where it could be foreseen, too.
    """

    drive: RecordedDrive
    moment: int
    stage: DriveStage
    observation: Mapping[str, Any]
    waypoints: NDArray[np.float32]
    valid: NDArray[np.float32]
    known: NDArray[np.float32]


def labels_of(
    config: SystemConfig,
    drive: RecordedDrive,
    moment: int,
    stage: DriveStage,
    observation: Mapping[str, Any],
    foreseen: Known = None,
) -> dict[str, Tensor]:
    """The labels of a moment, as a batch of one: `waypoints`, `valid`, and those that are named.

    Valid are the waypoints that are known and could be foreseen.
    """
    state = stage.view.state
    pose = np.array([state.x[0], state.y[0], state.yaw[0]])
    waypoints, valid = expert_waypoints(drive, moment, config.waypoints, pose)
    known = valid * foreseeable(foreseen, len(valid))
    labelled = LabelledMoment(
        drive=drive,
        moment=moment,
        stage=stage,
        observation=observation,
        waypoints=waypoints,
        valid=valid,
        known=known,
    )
    found: dict[str, NDArray[Any]] = {"waypoints": waypoints, "valid": known}
    found |= {name: LABELS[name](labelled) for name in config.labels}
    return {name: torch.from_numpy(value)[None] for name, value in found.items()}


def _action(at: LabelledMoment) -> NDArray[np.float32]:
    """(2,) throttle less brake, and steer, that lead to where the expert went.

    Where the ego is set aside its own control would not lead back; where the drive ends that is all
    there is. What nobody can foresee is waited for.
    """
    throttle, steer, brake = at.drive.controls[at.moment].tolist()
    if at.valid[:2].all():
        speed_mps = float(at.stage.view.state.speed[0])
        way = at.waypoints.copy()
        for place in np.flatnonzero(at.known == 0.0):
            way[place] = way[place - 1] if place else 0.0
        followed, _ = waypoints_to_control(way, speed_mps, ControllerMemory(), _FOLLOWING)
        throttle, steer, brake = followed.tolist()
    return np.array([throttle - brake, steer], np.float32)


def _raster(at: LabelledMoment) -> NDArray[np.float32]:
    """(C, X, Y) the true view from above, as teachers see it."""
    return true_raster(at.stage.view, np.asarray(at.observation["routing"]))


def _semantics(at: LabelledMoment) -> NDArray[np.uint8]:
    """(X, Y) `BevClass` on the zoo's grid."""
    return bev_semantics(at.stage.view, GRID)


def _objects(at: LabelledMoment) -> NDArray[np.float32]:
    """(OBJECTS, 9) who is on the grid, in sight or not, the nearest first; zeros for none.

    Columns are those of `driveinsight.seen`; the last is 1 for who is in sight, and -1 for who is
    hidden: nobody can be asked for him.
    """
    found, _ = seen_truth(at.stage.view, GRID)
    found = found[np.argsort(np.hypot(found[:, 0], found[:, 1]), kind="stable")][:OBJECTS]
    out = np.zeros((OBJECTS, OBJECT_COLUMNS), np.float32)
    out[: len(found)] = found
    out[: len(found), -1] = np.where(found[:, -1] > 0.0, 1.0, -1.0)
    return out


def _signal(at: LabelledMoment) -> NDArray[np.float32]:
    """(8,) the signal that governs the ego's lane, with the columns of `seen`; zeros for none."""
    _, found = seen_truth(at.stage.view, GRID)
    return found[0] if len(found) else np.zeros(SIGNAL_COLUMNS, np.float32)


def _map(at: LabelledMoment) -> NDArray[np.float32]:
    """(M, POINTS, 4) x, y, `MapKind`, valid of the lines around, as the prompt has them."""
    return np.asarray(at.observation["map"])


def _motion(at: LabelledMoment) -> NDArray[np.float32]:
    """(OBJECTS, T, 3) x, y, valid of those of `objects` at each waypoint's time."""
    return later_places(at.drive, at.moment, at.stage.view, _objects(at), len(at.valid))


def _future(at: LabelledMoment) -> NDArray[np.float16]:
    """(T, C, X, Y) what `raster` will be at each waypoint's time, seen from here."""
    routing = np.asarray(at.observation["routing"])
    return later_rasters(at.drive, at.moment, at.stage.view, routing, len(at.valid))


LABELS: Mapping[str, Callable[[LabelledMoment], NDArray[Any]]] = MappingProxyType(
    {
        "action": _action,
        "raster": _raster,
        "semantics": _semantics,
        "objects": _objects,
        "signal": _signal,
        "map": _map,
        "motion": _motion,
        "future": _future,
    }
)
