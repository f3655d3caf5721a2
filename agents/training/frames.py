"""A drive as states: what sensors and prompts are made from, a few kB a moment, no pictures.

Moments are 0.5 s apart, as in the paper. Of each all is kept that an observation reads: the ego,
the lights, and the actors round it. So pictures are made when they are wanted, in any weather, from
any camera, and with the ego set a little aside.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.files.json_text import JsonError, one_line, parsed, read_json
from di_envs.files.json_values import from_json
from di_envs.files.names import check_name
from di_envs.files.received import check_array, read_arrays
from di_envs.files.whole import write_whole
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.state import ActorKind, Capacity, State, state_dtype, views_of
from di_envs.world.world import WorldView

FRAME_S = 0.5
REACH_M = 120.0  # up to which actors are kept
FORMAT = 2
MOST_ACTORS = 10_000  # of a kind; no world has as many

# What is kept of actors; of egos, lights and the clock all is.
ACTOR_FIELDS = (
    *("kind", "x", "y", "z", "yaw", "speed", "acceleration", "yaw_rate"),
    *("half_length", "half_width", "height", "brake_light", "indicator", "walk_waiting"),
)


class DriveFileError(ValueError):
    """A file that holds no whole drive; the message says what to do."""


@dataclass(frozen=True, kw_only=True)
class RecordedDrive:
    """One route driven once.

    Attributes:
        facts: What it is: town, hash, route, seed, weather, scenarios triggered, events.
        capacity: Of the world that it was driven in.
        whole: By field of the state: (F, …) for each of F moments.
        actors: By field of `ACTOR_FIELDS`: (N,) over all moments, one after the other.
        actor_id: (N,) which actor each row is of.
        first: (F + 1,) rows of moment f are [first[f], first[f + 1]).
        controls: (F, 3) throttle, steer, brake that the expert chose at the moment.
        shown: Of a learner's drive: (F, W, 2) where the expert would have been afterwards, not a
            number where that is not known; see `corrections`. None where the expert drove itself.
    """

    facts: dict[str, Any]
    capacity: Capacity
    whole: dict[str, NDArray[Any]]
    actors: dict[str, NDArray[Any]]
    actor_id: NDArray[np.int16]
    first: NDArray[np.int64]
    controls: NDArray[np.float32]
    shown: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.first) - 1

    def poses(self) -> NDArray[np.float64]:
        """(F, 3) x, y, yaw of the ego."""
        own = self.first[:-1]  # the ego has the lowest id
        return np.stack([self.actors[name][own] for name in ("x", "y", "yaw")], axis=1)

    def speeds(self) -> NDArray[np.float64]:
        """(F,) forward speed of the ego [m/s]."""
        return self.actors["speed"][self.first[:-1]]

    def cut(self, moments: int) -> RecordedDrive:
        """The first moments alone."""
        rows = int(self.first[moments])
        return dataclasses.replace(
            self,
            whole={name: rows_[:moments] for name, rows_ in self.whole.items()},
            actors={name: values[:rows] for name, values in self.actors.items()},
            actor_id=self.actor_id[:rows],
            first=self.first[: moments + 1],
            controls=self.controls[:moments],
            shown=None if self.shown is None else self.shown[:moments],
        )

    def future(self, moment: int) -> NDArray[np.float64]:
        """(W, 2) where the expert was each `FRAME_S` afterwards, as far as that is known."""
        if self.shown is None:
            return self.poses()[moment + 1 :, :2]
        known = np.isfinite(self.shown[moment]).all(axis=1)
        return self.shown[moment, known]


def _whole_fields(capacity: Capacity) -> tuple[str, ...]:
    """Fields that are not of actors: those that one more actor does not make longer."""
    one, other = state_dtype(capacity), state_dtype(capacity._replace(walkers=capacity.walkers + 1))
    return tuple(name for name in State._fields if one[name].shape == other[name].shape)


@dataclass(kw_only=True)
class DriveLog:
    """Gathers moments while a route is driven.

    Attributes:
        view: Of the world; it shows the present.
        reach_m: Actors up to so far from the ego are kept.
    """

    view: WorldView
    reach_m: float = REACH_M
    whole: dict[str, list[NDArray[Any]]] = field(default_factory=dict)
    actors: dict[str, list[NDArray[Any]]] = field(default_factory=dict)
    ids: list[NDArray[np.int16]] = field(default_factory=list)
    controls: list[NDArray[np.float32]] = field(default_factory=list)

    def add(self, control: NDArray[np.float32]) -> None:
        """Adds the present moment, and what the expert does in it."""
        state = self.view.state
        near = np.hypot(state.x - state.x[0], state.y - state.y[0]) < self.reach_m
        ids = np.flatnonzero((state.kind != ActorKind.ABSENT) & near)
        for name in _whole_fields(self.view.capacity):
            self.whole.setdefault(name, []).append(getattr(state, name).copy())
        for name in ACTOR_FIELDS:
            self.actors.setdefault(name, []).append(getattr(state, name)[ids])
        self.ids.append(ids.astype(np.int16))
        self.controls.append(control.copy())

    def __len__(self) -> int:
        return len(self.ids)

    def drive(self, facts: dict[str, Any]) -> RecordedDrive:
        """The drive so far."""
        return RecordedDrive(
            facts=facts,
            capacity=self.view.capacity,
            whole={name: np.stack(values) for name, values in self.whole.items()},
            actors={name: np.concatenate(values) for name, values in self.actors.items()},
            actor_id=np.concatenate(self.ids),
            first=np.cumsum([0, *(len(ids) for ids in self.ids)]),
            controls=np.stack(self.controls),
        )


class DriveStage:
    """A world's state that is set to one moment of a drive after the other.

    Attributes:
        view: Of the moment that was set last.
    """

    def __init__(self, town: Town, plan: RoutePlan, capacity: Capacity) -> None:
        self._record = np.zeros(1, state_dtype(capacity))
        self._state = views_of(self._record)
        self.view = WorldView(town=town, state=self._state, plans=(plan,), capacity=capacity)

    def set(
        self, drive: RecordedDrive, moment: int, *, right_m: float = 0.0, turn_rad: float = 0.0
    ) -> None:
        """Shows a moment, with the ego set aside.

        Args:
            drive: Of this stage's town, route and capacity.
            moment: Which.
            right_m: How far the ego stands to the right of where it was.
            turn_rad: How far it is turned to the right.
        """
        state = self._state
        self._record.view(np.uint8)[...] = 0
        for name, values in drive.whole.items():
            getattr(state, name)[...] = values[moment]
        rows = slice(drive.first[moment], drive.first[moment + 1])
        ids = drive.actor_id[rows]
        for name in ACTOR_FIELDS:
            getattr(state, name)[ids] = drive.actors[name][rows]
        yaw = state.yaw[0]
        state.x[0] -= right_m * np.sin(yaw)
        state.y[0] += right_m * np.cos(yaw)
        state.yaw[0] = yaw + turn_rad


def write_drive(path: Path, drive: RecordedDrive) -> None:
    """Writes a drive; the file is there whole or not at all."""
    content: dict[str, Any] = {
        "format": np.array(FORMAT),
        "facts": np.array(json.dumps(drive.facts)),
        "capacity": np.array(drive.capacity),
        "actor_id": drive.actor_id,
        "first": drive.first,
        "controls": drive.controls,
    }
    if drive.shown is not None:
        content["shown"] = drive.shown
    content |= {f"whole.{name}": values for name, values in drive.whole.items()}
    content |= {f"actors.{name}": values for name, values in drive.actors.items()}
    write_whole(path, lambda file: np.savez_compressed(file, **content))


def write_dropped(path: Path, why: str, driven_by: Mapping[str, Any]) -> None:
    """Writes why a drive is left out, and by whom it was driven, in place of it."""
    write_whole(path, one_line({"why": why, **driven_by}))


def read_dropped(path: Path) -> Mapping[str, Any]:
    """Why a drive was left out (`why`), and by whom it was driven.

    Raises:
        DriveFileError: If the file is missing, or does not say so.
    """
    try:
        facts = from_json(dict[str, Any], read_json(path), str(path))
        why = from_json(str, facts["why"], str(path), "why")
        return {**facts, "why": why}
    except (JsonError, KeyError) as error:
        raise DriveFileError(
            f"{path} does not say why ({error}): delete it and run collect again"
        ) from error


def read_drive(path: Path) -> RecordedDrive:
    """Reads a drive.

    Raises:
        DriveFileError: If the file is missing, cut off, or of another format.
    """
    try:
        content = read_arrays(path)
        version = int(content["format"])
        if version != FORMAT:
            raise DriveFileError(
                f"{path} is of format {version}, this program reads {FORMAT}: collect it again"
            )
        drive = RecordedDrive(
            facts=_facts(str(content["facts"])),
            capacity=Capacity(*content["capacity"].tolist()),
            whole=_part("whole.", content),
            actors=_part("actors.", content),
            actor_id=content["actor_id"],
            first=content["first"],
            controls=content["controls"],
            shown=content.get("shown"),
        )
        _check(drive)
    except DriveFileError:
        raise
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        raise DriveFileError(
            f"{path} is missing or not whole ({error!r}): delete it and run collect again"
        ) from error
    return drive


@dataclass(frozen=True, kw_only=True)
class _Facts:
    """What is read of a drive's facts; there are more."""

    town: str
    town_hash: str
    number: int
    route_id: str
    scenarios: dict[str, int] = field(default_factory=dict)


def _facts(text: str) -> dict[str, Any]:
    facts = from_json(dict[str, Any], parsed(text, "facts"), "facts")
    from_json(_Facts, facts, "facts", foreign=True)
    return facts


def _check(drive: RecordedDrive) -> None:
    """Refuses arrays that do not belong together, with numbers that no drive has.

    Raises:
        ValueError: Names the array.
    """
    moments, actors = len(drive.first) - 1, len(drive.actor_id)
    capacity = drive.capacity
    if min(capacity) < 0 or max(capacity) > MOST_ACTORS or moments < 1:
        raise ValueError(f"capacity: {capacity} of {moments} moments is none of a drive")
    check_array({"first": drive.first}, "first", "iu", (None,))
    check_array({"actor_id": drive.actor_id}, "actor_id", "iu", (None,))
    check_array({"controls": drive.controls}, "controls", "f", (moments, None), finite=True)
    steps = np.diff(drive.first)
    if drive.first[0] != 0 or drive.first[-1] != actors or (steps < 1).any():
        raise ValueError("first: does not share the actors out among the moments")
    layout = state_dtype(capacity)
    if ((drive.actor_id < 0) | (drive.actor_id >= layout["x"].shape[0])).any():
        raise ValueError("actor_id: names an actor that there is not")
    for name in drive.whole:
        check_name(name, _whole_fields(capacity), "field of a state")
        check_array(drive.whole, name, layout[name].base.kind, (moments, *layout[name].shape))
    for name in ACTOR_FIELDS:
        check_array(drive.actors, name, layout[name].base.kind, (actors,), finite=True)


def _part(prefix: str, content: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    return {
        name.removeprefix(prefix): values
        for name, values in content.items()
        if name.startswith(prefix)
    }
