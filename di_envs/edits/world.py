"""World edits: something else is there from now on. Small values with a text form.

    remove:actor=17                 the actor is gone
    move:actor=17,ahead=5,right=-3  it is set down elsewhere, metres in its own axes
    force:light=12,state=red        the light shows red from now on; state=none: its turn's again
    change:weather=HardRainNoon     cameras see other weather

Unlike an edit of what an agent sees, a world edit changes what there is. Applied to a moment of an
episode it begins another future; what came before stays as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from typing_extensions import Self

from di_envs.config import WEATHERS, check_name
from di_envs.edits.conditions import number_text
from di_envs.edits.text import EditError, EditText, read_edits

if TYPE_CHECKING:
    from di_envs.route_env import RouteEnv

_LIGHT_STATES = ("none", "green", "yellow", "red")  # in the order of `LightState`


class WorldEdit(Protocol):
    """A change of the world at one moment."""

    def to_text(self) -> EditText:
        """As it is written."""
        ...

    def apply(self, env: RouteEnv) -> None:
        """Makes the change in an episode under way.

        Raises:
            EditError: If it cannot be made at this moment.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class RemoveActor:
    """An actor is gone. Its id is what events call `other`."""

    actor: int

    def to_text(self) -> EditText:
        return EditText(verb="remove", target="actor", value=str(self.actor))

    @classmethod
    def of(cls, text: EditText) -> Self:
        text.refuse_settings_but(())
        return cls(actor=text.whole_value())

    def apply(self, env: RouteEnv) -> None:
        if self.actor < env.view.capacity.egos:
            raise EditError(f"'{self.to_text()}': actor {self.actor} is the ego, which drives")
        env.world.remove_actor(self.actor)


@dataclass(frozen=True, kw_only=True)
class MoveActor:
    """A vehicle or walker is set down elsewhere, on the lane or way nearest to that place.

    Attributes:
        actor: Its id.
        ahead_m: How far along its own heading.
        right_m: How far to its right.
    """

    actor: int
    ahead_m: float = 0.0
    right_m: float = 0.0

    def to_text(self) -> EditText:
        settings = {"ahead": self.ahead_m, "right": self.right_m}
        return EditText(
            verb="move",
            target="actor",
            value=str(self.actor),
            settings={name: number_text(metres) for name, metres in settings.items() if metres},
        )

    @classmethod
    def of(cls, text: EditText) -> Self:
        text.refuse_settings_but(("ahead", "right"))
        return cls(
            actor=text.whole_value(),
            ahead_m=text.number("ahead"),
            right_m=text.number("right"),
        )

    def apply(self, env: RouteEnv) -> None:
        env.world.move_actor(self.actor, self.ahead_m, self.right_m)


@dataclass(frozen=True, kw_only=True)
class ForceLight:
    """A traffic light shows one state from now on.

    Attributes:
        light: Its index, as the events of red lights call it.
        state: `green`, `yellow` or `red`; `none` gives it back to its turn.
    """

    light: int
    state: str

    def __post_init__(self) -> None:
        try:
            check_name(self.state, _LIGHT_STATES, "state of a light")
        except ValueError as error:
            raise EditError(str(error)) from error

    def to_text(self) -> EditText:
        settings = {"state": self.state}
        return EditText(verb="force", target="light", value=str(self.light), settings=settings)

    @classmethod
    def of(cls, text: EditText) -> Self:
        text.refuse_settings_but(("state",))
        if "state" not in text.settings:
            raise EditError(f"'{text}' does not say what it shows: add ,state=red for instance")
        return cls(light=text.whole_value(), state=text.settings["state"])

    def apply(self, env: RouteEnv) -> None:
        from di_envs.town.lanes import LightState

        env.world.force_light(self.light, LightState(_LIGHT_STATES.index(self.state)))


@dataclass(frozen=True, kw_only=True)
class ChangeWeather:
    """Cameras see other weather: one of CARLA's presets."""

    weather: str

    def __post_init__(self) -> None:
        try:
            check_name(self.weather, WEATHERS, "weather")
        except ValueError as error:
            raise EditError(str(error)) from error

    def to_text(self) -> EditText:
        return EditText(verb="change", target="weather", value=self.weather)

    @classmethod
    def of(cls, text: EditText) -> Self:
        text.refuse_settings_but(())
        if text.value is None:
            raise EditError(f"'{text}' does not say which: write change:weather=HardRainNoon")
        return cls(weather=text.value)

    def apply(self, env: RouteEnv) -> None:
        env.change_weather(self.weather)


# One literal table: what can be written in front of an edit's first `=`.
WORLD_EDITS: Mapping[str, Callable[[EditText], WorldEdit]] = {
    "remove:actor": RemoveActor.of,
    "move:actor": MoveActor.of,
    "force:light": ForceLight.of,
    "change:weather": ChangeWeather.of,
}


def is_world_edit(text: EditText) -> bool:
    """Whether an edit is of the world, not of what somebody sees of it."""
    return f"{text.verb}:{text.target}" in WORLD_EDITS


def read_world_edits(text: str) -> tuple[WorldEdit, ...]:
    """Reads world edits joined by `;`, such as `remove:actor=17; force:light=3,state=red`.

    Raises:
        EditError: If one cannot be read; unknown ones are told the nearest that there is.
    """
    return tuple(world_edit(edit) for edit in read_edits(text))


def world_edit(text: EditText) -> WorldEdit:
    """The world edit that a text is.

    Raises:
        EditError: If there is none of that name, or its values are refused.
    """
    name = f"{text.verb}:{text.target}"
    try:
        check_name(name, WORLD_EDITS, "world edit")
    except ValueError as error:
        raise EditError(str(error)) from error
    if text.when:
        raise EditError(
            f"'{text}': a world edit happens when it is applied; leave out @{text.when}"
        )
    return WORLD_EDITS[name](text)


def apply_world_edits(env: RouteEnv, edits: Sequence[WorldEdit]) -> None:
    """Makes changes in an episode under way, one after the other.

    Raises:
        EditError: If one cannot be made at this moment; those before it are made.
    """
    from di_envs.world.changes import ChangeError

    for edit in edits:
        try:
            edit.apply(env)
        except ChangeError as error:
            raise EditError(f"'{edit.to_text()}': {error}") from error
