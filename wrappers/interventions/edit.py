"""What an observation edit is: a small frozen value that is written, read, checked and applied.

An edit of one's own is a dataclass with a verb, settings, and `edited`:

    @dataclass(frozen=True, kw_only=True)
    class Scale(ObservationEdit):
        verb = "scale"
        by: float = setting("by", low=0.0)

        def edited(self, name, value, draws, context):
            return value * self.by
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field
from functools import cache
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from typing_extensions import Self

from di_envs.edits.conditions import ALWAYS, Condition, number_text
from di_envs.edits.text import EditError, EditText
from di_envs.numerics.keyed_arrays import keyed_normals, keyed_uniforms, stream_of
from wrappers.interventions.context import EditContext

Observation = Mapping[str, Any]
_INFINITE = float("inf")


@dataclass(frozen=True, kw_only=True)
class Setting:
    """How a field of an edit is written: its name, type and range; `value`: behind the target."""

    name: str
    kind: type = float
    low: float = -_INFINITE
    high: float = _INFINITE
    value: bool = False


def setting(
    name: str,
    *,
    kind: type = float,
    default: Any = MISSING,
    low: float = -_INFINITE,
    high: float = _INFINITE,
    value: bool = False,
) -> Any:
    """A field of an edit that stands in its text.

    Args:
        name: What it is called there.
        kind: `float`, `int` or `str`.
        default: What it is if it is not written; without one it must be.
        low: The least that it may be.
        high: The most.
        value: It stands behind the target's `=`, without a name.
    """
    told = Setting(name=name, kind=kind, low=low, high=high, value=value)
    return field(default=default, metadata={"setting": told})


@dataclass(frozen=True, kw_only=True)
class Draws:
    """Keyed random numbers for one target of one edit at one moment."""

    edit: ObservationEdit
    target: str
    context: EditContext

    def uniforms(self, *shape: int) -> NDArray[np.float64]:
        """(..., *shape) in [0, 1)."""
        return self._drawn(keyed_uniforms, shape)

    def normals(self, *shape: int) -> NDArray[np.float64]:
        """(..., *shape) standard normal."""
        return self._drawn(keyed_normals, shape)

    def words(self, *shape: int) -> NDArray[np.uint16]:
        """(..., *shape) whole numbers below 65536: three of each draw, for very many of them."""
        count = math.prod(shape)
        drawn = self.uniforms(-(-count // 3))
        words = (drawn * 2.0**48).astype("<u8").view("<u2")
        threes = words.reshape(*drawn.shape, 4)[..., :3].reshape(*drawn.shape[:-1], -1)
        return threes[..., :count].reshape(*drawn.shape[:-1], *shape)

    def _drawn(
        self, draw: Callable[..., NDArray[np.float64]], shape: tuple[int, ...]
    ) -> NDArray[np.float64]:
        context = self.context
        first = np.left_shift(context.ego, 32)  # each ego has numbers of its own
        return draw(context.seed, _stream(self.edit, self.target), context.tick, shape, first)


@cache
def _stream(edit: ObservationEdit, target: str) -> int:
    """What draws are keyed by: what is done to what, whenever and after whatever else."""
    text = dataclasses.replace(edit.to_text(), target=target, when="")
    return stream_of(f"edit {text}")


@dataclass(frozen=True, kw_only=True)
class ObservationEdit:
    """Something else is seen.

    Attributes:
        targets: What is edited: names of the observation's entries, `lights`, `cameras` or `all`.
        when: While it holds.
        verb: What is written in front of the target.
        stays: Whether what it makes of a value in the space is always in the space; if not, it is
            clipped to it.
        remembers: Whether it has a memory, which must see moments at which it does not hold.
    """

    targets: tuple[str, ...]
    when: Condition = ALWAYS

    verb: ClassVar[str]
    stays: ClassVar[bool] = False
    remembers: ClassVar[bool] = False

    def __post_init__(self) -> None:
        for name, told in self.settings().items():
            number = getattr(self, name)
            if told.kind is not str and number is not None:
                if not told.low <= number <= told.high or abs(number) == _INFINITE:
                    raise EditError(
                        f"{self.verb}: {told.name} lies in [{told.low:g}, {told.high:g}], "
                        f"not {number!r}"
                    )

    @classmethod
    def settings(cls) -> Mapping[str, Setting]:
        """Its fields that stand in its text."""
        return {
            part.name: part.metadata["setting"]
            for part in dataclasses.fields(cls)
            if "setting" in part.metadata
        }

    @classmethod
    def of(cls, text: EditText) -> Self:
        """The edit that a text is.

        Raises:
            EditError: If something is missing, unknown or out of range.
        """
        told = cls.settings()
        text.refuse_settings_but([each.name for each in told.values() if not each.value])
        if text.value is not None and not any(each.value for each in told.values()):
            raise EditError(f"'{text}': {text.verb} takes no '={text.value}'")
        defaults = {part.name: part.default for part in dataclasses.fields(cls)}
        values: dict[str, Any] = {}
        for name, each in told.items():
            written = text.value if each.value else text.settings.get(each.name)
            if written is not None:
                values[name] = _read(written, each, text)
            elif defaults[name] is MISSING:
                example = "=VALUE" if each.value else f",{each.name}=VALUE"
                raise EditError(f"'{text}' does not say its {each.name}: add {example}")
        try:
            return cls(
                targets=tuple(text.target.split("+")), when=Condition.of(text.when), **values
            )
        except EditError as error:
            raise EditError(f"'{text}': {error}") from error

    def to_text(self) -> EditText:
        """As it is written: settings that have their defaults are left out."""
        value: str | None = None
        settings: dict[str, str] = {}
        defaults = {part.name: part.default for part in dataclasses.fields(self)}
        for name, told in self.settings().items():
            given = getattr(self, name)
            if told.value:
                value = _written(given)
            elif given != defaults[name]:
                settings[told.name] = _written(given)
        return EditText(
            verb=self.verb,
            target="+".join(self.targets),
            value=value,
            settings=settings,
            when=str(self.when),
        )

    def __str__(self) -> str:
        return str(self.to_text())

    def check(self, name: str, space: spaces.Dict) -> None:
        """Refuses an entry of the observation that it cannot edit.

        Args:
            name: The entry.
            space: Of the whole observation of one world.

        Raises:
            EditError: If it cannot.
        """

    def edited(self, name: str, value: Any, draws: Draws, context: EditContext) -> Any:
        """What is shown in place of a value.

        Args:
            name: Entry of the observation.
            value: (..., *shape) what it is, of one world or of many; a copy, to be written to.
            draws: Random numbers.
            context: The moment.

        Returns:
            The same shape and type.
        """
        raise NotImplementedError(f"{type(self).__name__} does not say what it makes of a value")

    def changes(
        self,
        names: tuple[str, ...],
        observation: Observation,
        context: EditContext,
        memory: Any,
    ) -> tuple[dict[str, Any], Any]:
        """The entries that are shown otherwise, and the memory for the next moment.

        Args:
            names: Entries that its targets name.
            observation: What there is to see, after the edits before this one; not written to.
            context: The moment.
            memory: What it returned at the moment before; None at first.
        """
        shown = {}
        for name in names:
            draws = Draws(edit=self, target=name, context=context)
            shown[name] = self.edited(name, np.array(observation[name]), draws, context)
        return shown, memory


def _read(written: str, told: Setting, text: EditText) -> Any:
    if told.kind is str:
        return written
    try:
        return told.kind(written)
    except ValueError as error:
        kind = "a whole number" if told.kind is int else "a number"
        raise EditError(f"'{text}': {told.name} is {kind}, not '{written}'") from error


def _written(value: Any) -> str:
    return value if isinstance(value, str) else number_text(value)
