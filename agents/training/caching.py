"""Moments as compact rows: the prompt, who is truly in sight, and where the expert went.

A moment is encoded once, at some 5 kB; a planner that learns from such rows sees no picture, and
learns at hundreds of samples a second. The rows are of the ego where it was: `planning` sets it
aside when a batch is made, which moves numbers and needs no rendering.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.driveinsight.heads import CLASS_OF_KIND, KIND_OF_CLASS
from agents.driveinsight.seen import OBJECT_COLUMNS, OBJECTS, SIGNAL_COLUMNS, SIGNALS
from agents.networks.grid import GridConfig
from agents.training.config import TrainingError
from agents.training.frames import DriveFileError, DriveStage, RecordedDrive, read_drive
from agents.training.loading import town_of
from agents.training.moments import Moments
from agents.training.truth import seen_truth
from agents.training.waypoints import expert_waypoints
from di_envs.files.whole import write_whole
from di_envs.observer import Observer
from di_envs.prompt import (
    LIGHTS,
    MAP_POLYLINES,
    OBSTACLES,
    ROUTING_POINTS,
    SPEED_HISTORY,
    STOP_SIGNS,
)
from di_envs.town.map_chunks import POINTS
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.kinds import ActorKind
from di_envs.world.world import WorldView

FORMAT = 2  # of the files; a change of the rows raises it
MOST = 100_000  # moments that a cache holds
WAYPOINTS = 8  # of the expert that are kept

# Places and yaws are float16: 3 cm at 50 m. Kinds stand as numbers in float16 rows, exactly.
MOMENT = np.dtype(
    [
        ("command", "u1"),
        ("target_point", "f4", 3),
        ("routing", "f2", (ROUTING_POINTS, 4)),
        ("map_places", "f2", (MAP_POLYLINES, POINTS, 2)),
        ("map_kinds", "u1", (MAP_POLYLINES, POINTS)),  # 0 where there is no point
        ("obstacles", "f2", (OBSTACLES, OBJECT_COLUMNS)),
        ("traffic_lights", "f2", (LIGHTS, 5)),
        ("stop_signs", "f2", (STOP_SIGNS, 4)),
        ("speed", "f4", 1),
        ("speed_history", "f4", SPEED_HISTORY),
        ("objects", "f2", (OBJECTS, OBJECT_COLUMNS)),  # in sight, the nearest first
        ("signals", "f2", (SIGNALS, SIGNAL_COLUMNS)),
        ("waypoints", "f4", (WAYPOINTS, 2)),
        ("valid", "u1", WAYPOINTS),
    ]
)
_STORED = np.dtype([("moment", "i4"), ("row", MOMENT)])  # a row of a file
_KIND = 7  # column of an object
# By `ActorKind`, as which of them perception takes it: a van and a car look alike
_SEEMS = np.array(
    [KIND_OF_CLASS[CLASS_OF_KIND[kind]] if kind in CLASS_OF_KIND else 0 for kind in ActorKind],
    np.float32,
)
_AS_TOLD = (
    *("command", "target_point", "routing", "obstacles", "traffic_lights", "stop_signs"),
    *("speed", "speed_history"),
)


def truly_seen(
    view: WorldView, grid: GridConfig
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The rows of `Seen` that perfect eyes would see: of many objects the nearest.

    Returns:
        (OBJECTS, 9) and (SIGNALS, 8), zeros where there is no more.
    """
    found, signal = seen_truth(view, grid)
    found = found[found[:, -1] > 0.0]
    nearest = np.argsort(np.hypot(found[:, 0], found[:, 1]), kind="stable")[:OBJECTS]
    objects = np.zeros((OBJECTS, OBJECT_COLUMNS), np.float32)
    signals = np.zeros((SIGNALS, SIGNAL_COLUMNS), np.float32)
    objects[: len(nearest)] = found[nearest]
    objects[:, _KIND] = _SEEMS[objects[:, _KIND].astype(np.int64)]
    signals[: len(signal)] = signal[:SIGNALS]
    return objects, signals


class MomentReader:
    """Reads moments of drives in one town."""

    def __init__(self, town: Town, plan_of: Callable[[str], RoutePlan], grid: GridConfig) -> None:
        self._town, self._plan_of, self._grid = town, plan_of, grid
        self._stages: dict[Any, tuple[DriveStage, Observer]] = {}

    def read(self, drive: RecordedDrive, moment: int, out: NDArray[np.void]) -> None:
        """Writes a moment of a drive into a row of `MOMENT`s."""
        stage, observer = self._stage(str(drive.facts["route_id"]), drive.capacity)
        stage.set(drive, moment)
        told = observer.observe()
        for name in _AS_TOLD:
            out[name] = told[name]
        out["map_places"] = told["map"][:, :, :2]
        out["map_kinds"] = told["map"][:, :, 2] * told["map"][:, :, 3]
        out["objects"], out["signals"] = truly_seen(stage.view, self._grid)
        pose = drive.poses()[moment]
        out["waypoints"], out["valid"] = expert_waypoints(drive, moment, WAYPOINTS, pose)

    def _stage(self, route_id: str, capacity: Any) -> tuple[DriveStage, Observer]:
        key = (route_id, capacity)
        if key not in self._stages:
            self._stages.clear()  # drives come one after the other
            stage = DriveStage(self._town, self._plan_of(route_id), capacity)
            observer = Observer(self._town, ("prompt",))
            observer.start(stage.view)
            self._stages[key] = (stage, observer)
        return self._stages[key]


@dataclass(frozen=True, kw_only=True)
class MomentCache:
    """Moments that are encoded.

    Attributes:
        moments: Which they are.
        rows: (M,) of `MOMENT`, in their order.
    """

    moments: Moments
    rows: NDArray[np.void]


def cached(
    moments: Moments,
    grid: GridConfig,
    folder: Path,
    *,
    on_moment: Callable[[int], None] = lambda count: None,
) -> MomentCache:
    """The moments encoded, at most `MOST` of them; those of a drive are read if they are there.

    Args:
        moments: Of drives.
        grid: Within which somebody is seen.
        folder: Where there is a file for each drive, named by a hash of it and by the grid.
        on_moment: Told after each drive how many moments are done.

    Raises:
        TrainingError: If a drive is of another version of its town, or a file is not whole.
        DriveFileError: If a drive is not whole.
    """
    kept = moments.thinned(MOST)
    rows = np.zeros(len(kept), MOMENT)
    shelf = _Shelf(folder=folder, grid=grid)
    for number in np.unique(kept.drive):
        own = np.flatnonzero(kept.drive == number)
        rows[own] = shelf.rows(kept.paths[number], kept.moment[own])
        on_moment(int(own[-1]) + 1)
    return MomentCache(moments=kept, rows=rows)


@dataclass(frozen=True, kw_only=True)
class _Shelf:
    """Encoded drives in a folder.

    Attributes:
        folder: Where.
        grid: Within which somebody is seen.
        readers: Of towns, by their names.
    """

    folder: Path
    grid: GridConfig
    readers: dict[str, MomentReader] = field(default_factory=dict)

    def rows(self, drive: Path, wanted: NDArray[np.int64]) -> NDArray[np.void]:
        """Some moments of a drive, encoded now if they have not been before."""
        path = self._path(drive)
        if path.exists():
            stored = _read(path)
            where = np.searchsorted(stored["moment"], wanted).clip(max=len(stored) - 1)
            if np.array_equal(stored["moment"][where], wanted):
                return stored["row"][where]
        fresh = np.zeros(len(wanted), _STORED)
        fresh["moment"] = wanted
        self._encode(read_drive(drive), fresh)
        write_whole(path, lambda file: np.save(file, fresh))
        return fresh["row"]

    def _path(self, drive: Path) -> Path:
        sides = (self.grid.x_min_m, self.grid.x_max_m, self.grid.y_min_m, self.grid.y_max_m)
        digest = hashlib.blake2b(f"{FORMAT} {sides} ".encode(), digest_size=16)
        try:
            digest.update(drive.read_bytes())
        except OSError as error:
            raise DriveFileError(
                f"{drive} is missing or not whole ({error!r}): run collect again"
            ) from error
        return self.folder / f"{digest.hexdigest()}.npy"

    def _encode(self, drive: RecordedDrive, out: NDArray[np.void]) -> None:
        name = str(drive.facts["town"])
        if name not in self.readers:
            self.readers[name] = MomentReader(*town_of(drive), self.grid)
        for stored in out:
            self.readers[name].read(drive, int(stored["moment"]), stored["row"])


def _read(path: Path) -> NDArray[np.void]:
    """Encoded moments of a drive, by rising number."""
    try:
        stored: NDArray[np.void] = np.load(path, allow_pickle=False)
        whole = stored.dtype == _STORED and len(stored) > 0
    except (OSError, ValueError, EOFError) as error:
        raise TrainingError(f"{path} is not whole ({error}): delete it to encode again") from error
    if not whole:
        raise TrainingError(f"{path} holds no encoded moments: delete it to encode again")
    return stored
