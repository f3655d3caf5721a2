"""Edits of what the prompt says: set, noise, shift, recolour, replace.

Rows that are not valid are left as they are: an edit makes nothing appear.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from typing_extensions import Self

from di_envs.config import check_name
from di_envs.edits.conditions import Condition, number_text
from di_envs.edits.text import EditError, EditText
from di_envs.town.lanes import LightState
from di_envs.town.plan import RoadOption
from wrappers.interventions.context import EditContext
from wrappers.interventions.edit import Draws, ObservationEdit, setting
from wrappers.interventions.layout import COLUMNS, column, has_valid, is_camera

_COMMANDS = {"NONE": 0, **{option.name: int(option) for option in RoadOption if option > 0}}
_LIGHTS = {state.name.lower(): int(state) for state in LightState}
_SPEEDS = ("speed", "speed_history")


def _there(name: str, value: NDArray[Any]) -> Any:
    """(...) which rows of a table are valid; True where all are."""
    return value[..., -1] > 0 if has_valid(name) else True


@dataclass(frozen=True, kw_only=True)
class SetValue(ObservationEdit):
    """Numbers are the same whatever they were: `set:speed=10`, `set:target_point,x=30,y=0`.

    Attributes:
        number: What speeds are; None for a table.
        columns: What columns of a table are in its valid rows.
    """

    verb = "set"
    stays = True  # refused otherwise
    number: float | None = setting("value", value=True, default=None)
    columns: tuple[tuple[str, float], ...] = ()

    @classmethod
    def of(cls, text: EditText) -> Self:
        if (text.value is None) == (not text.settings):
            raise EditError(
                f"'{text}' does not say what to set: write set:speed=10, or a table's columns, "
                "set:target_point,x=30,y=0"
            )
        number = None
        if text.value is not None:
            number = EditText(verb="set", target="speed", settings={"=": text.value}).number("=")
        return cls(
            targets=tuple(text.target.split("+")),
            when=Condition.of(text.when),
            number=number,
            columns=tuple((name, text.number(name)) for name in text.settings),
        )

    def to_text(self) -> EditText:
        return EditText(
            verb=self.verb,
            target="+".join(self.targets),
            value=None if self.number is None else number_text(self.number),
            settings={name: number_text(number) for name, number in self.columns},
            when=str(self.when),
        )

    def check(self, name: str, space: spaces.Dict) -> None:
        part: Any = space[name]
        if self.number is not None:
            if name not in _SPEEDS:
                columns = ", ".join(COLUMNS.get(name, ()))
                hint = f"name its columns ({columns})" if columns else "speed and speed_history are"
                raise EditError(f"'{self}': {name} is no plain number; {hint}")
            _refuse_outside(self, name, self.number, part.low.max(), part.high.min())
        for label, number in self.columns:
            if name not in COLUMNS:
                raise EditError(f"'{self}': {name} has no columns; write set:{name}=NUMBER")
            index = column(label, name)
            if label == "valid":
                raise EditError(f"'{self}': an edit makes no row appear; write clear:{name}")
            low, high = (bound[..., index].flat[0] for bound in (part.low, part.high))
            _refuse_outside(self, name, number, low, high)

    def edited(self, name: str, value: Any, draws: Draws, context: EditContext) -> Any:
        if self.number is not None:
            value[...] = self.number
        there = _there(name, value)
        for label, number in self.columns:
            index = column(label, name)
            value[..., index] = np.where(there, number, value[..., index])
        return value


def _refuse_outside(edit: ObservationEdit, name: str, number: float, low: Any, high: Any) -> None:
    if not low <= number <= high:
        raise EditError(f"'{edit}': {name} lies in [{low:g}, {high:g}], not {number:g}")


@dataclass(frozen=True, kw_only=True)
class Noise(ObservationEdit):
    """Gaussian noise, anew at every moment: on places [m], on speeds [m/s], on grey levels.

    Attributes:
        sigma: Its standard deviation, in the numbers' own unit.
        seed: Another one draws other noise.
    """

    verb = "noise"
    sigma: float = setting("sigma", low=0.0)
    seed: int = setting("seed", kind=int, default=0, low=0)

    def check(self, name: str, space: spaces.Dict) -> None:
        if not (name in COLUMNS or name in (*_SPEEDS, "imu", "lidar") or is_camera(space[name])):
            raise EditError(f"'{self}': {name} holds no places, speeds or images to add noise to")

    def edited(self, name: str, value: Any, draws: Draws, context: EditContext) -> Any:
        batch = np.ndim(context.tick)
        if name in COLUMNS or name == "lidar":
            places = value[..., : 3 if name == "lidar" else 2]
            noise = draws.normals(*places.shape[batch:])
            there = (value != 0).any(axis=-1) if name == "lidar" else _there(name, value)
            places += np.where(np.asarray(there)[..., None], self.sigma * noise, 0.0)
            return value
        if value.dtype == np.uint8:
            greys = _grey_noise(self.sigma)[draws.words(*value.shape[batch:])]
            return np.clip(value + greys, 0, 255).astype(np.uint8)
        noisy = value + self.sigma * draws.normals(*value.shape[batch:])
        return noisy.astype(value.dtype)


@lru_cache(maxsize=8)
def _grey_noise(sigma: float) -> NDArray[np.int16]:
    """(65536,) whole grey levels: what a normal number is at the middle of each quantile.

    A table, as pictures have very many numbers: this is exact to half a grey level, out to 4.3
    standard deviations.
    """
    normal = NormalDist()
    quantiles = [normal.inv_cdf((number + 0.5) / 65536) for number in range(65536)]
    greys: NDArray[np.int16] = np.rint(np.clip(sigma * np.array(quantiles), -255, 255)).astype(
        np.int16
    )
    return greys


@dataclass(frozen=True, kw_only=True)
class Shift(ObservationEdit):
    """Places are moved, each in its own direction: a route beside the route, not across it.

    Polylines of the map have no direction of their own and are moved in the ego's.

    Attributes:
        lateral_m: To the right.
        ahead_m: Ahead.
    """

    verb = "shift"
    lateral_m: float = setting("lateral", default=0.0)
    ahead_m: float = setting("ahead", default=0.0)

    def check(self, name: str, space: spaces.Dict) -> None:
        if name not in COLUMNS:
            raise EditError(f"'{self}': {name} holds no places to move; {', '.join(COLUMNS)} do")

    def edited(self, name: str, value: Any, draws: Draws, context: EditContext) -> Any:
        yaw = value[..., 2] if "yaw" in COLUMNS[name] else np.zeros_like(value[..., 0])
        cos, sin = np.cos(yaw), np.sin(yaw)
        there = _there(name, value)
        value[..., 0] += np.where(there, self.ahead_m * cos - self.lateral_m * sin, 0.0)
        value[..., 1] += np.where(there, self.ahead_m * sin + self.lateral_m * cos, 0.0)
        return value


@dataclass(frozen=True, kw_only=True)
class Recolour(ObservationEdit):
    """Traffic lights are seen in another colour.

    Attributes:
        colour: `green`, `yellow` or `red`; `none` for lights that are out.
        seen: Only those that have this colour; None for all.
    """

    verb = "recolour"
    stays = True
    colour: str = setting("colour", kind=str, value=True)
    seen: str | None = setting("from", kind=str, default=None)

    def __post_init__(self) -> None:
        for name in filter(None, (self.colour, self.seen)):
            _known(name, _LIGHTS, "colour of a light")

    def check(self, name: str, space: spaces.Dict) -> None:
        if name != "traffic_lights":
            raise EditError(f"'{self}': {name} has no colours; write recolour:lights={self.colour}")

    def edited(self, name: str, value: Any, draws: Draws, context: EditContext) -> Any:
        state = value[..., column("state", name)]
        chosen = _there(name, value)
        if self.seen is not None:
            chosen = chosen & (state == _LIGHTS[self.seen])
        state[...] = np.where(chosen, _LIGHTS[self.colour], state)
        return value


@dataclass(frozen=True, kw_only=True)
class Replace(ObservationEdit):
    """The command is another one: LEFT, RIGHT, STRAIGHT, LANEFOLLOW, …, or NONE."""

    verb = "replace"
    stays = True
    command: str = setting("command", kind=str, value=True)

    def __post_init__(self) -> None:
        _known(self.command, _COMMANDS, "command")

    def check(self, name: str, space: spaces.Dict) -> None:
        if name != "command":
            raise EditError(f"'{self}': {name} is no command; write replace:command={self.command}")

    def edited(self, name: str, value: Any, draws: Draws, context: EditContext) -> Any:
        return np.full_like(value, _COMMANDS[self.command])


def _known(name: str, known: Any, what: str) -> None:
    try:
        check_name(name, known, what)
    except ValueError as error:
        raise EditError(str(error)) from error
