"""The text form that all edits share: `verb:target=value,name=value@when`.

`remove:actor=17`, `move:actor=17,ahead=5`, `force:light=12,state=red@t=42`. Edits that follow each
other are joined by `;`. What verbs, targets and names mean is for whoever reads an `EditText`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from di_envs.config import check_name
from di_envs.files.plain_text import one_plain_line

_WORD = r"[A-Za-z_][A-Za-z0-9_.]*"
_VALUE = r"[^,;@=\s]+"
_FORM = re.compile(
    rf"(?P<verb>{_WORD}):(?P<target>{_WORD}(?:\+{_WORD})*)(?:=(?P<value>{_VALUE}))?"
    rf"(?P<rest>(?:,{_WORD}={_VALUE})*)(?:@(?P<when>[^;@\s]+))?"
)
_EXAMPLE = "such as remove:actor=17 or move:actor=17,ahead=5"


class EditError(ValueError):
    """An edit that cannot be read or carried out; the message says what to write instead."""

    def __init__(self, message: str) -> None:
        super().__init__(one_plain_line(message))  # it quotes what was written


@dataclass(frozen=True, kw_only=True)
class EditText:
    """One edit as it is written.

    Attributes:
        verb: What is done.
        target: What it is done to; several are joined by `+`.
        value: What stands behind the target's `=`; None for nothing.
        settings: What follows, by name.
        when: What stands behind `@`; empty for always.
    """

    verb: str
    target: str
    value: str | None = None
    settings: Mapping[str, str] = field(default_factory=dict)
    when: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "settings", MappingProxyType(dict(self.settings)))

    def __str__(self) -> str:
        value = "" if self.value is None else f"={self.value}"
        settings = "".join(f",{name}={setting}" for name, setting in self.settings.items())
        return f"{self.verb}:{self.target}{value}{settings}{self.when and '@' + self.when}"

    def refuse_settings_but(self, known: Iterable[str]) -> None:
        """Refuses settings that the edit does not have.

        Raises:
            EditError: If there is one; suggests the nearest.
        """
        names = tuple(known)
        for name in self.settings:
            if not names:
                raise EditError(f"'{self}': {self.verb}:{self.target} has no settings")
            try:
                check_name(name, names, f"setting of {self.verb}:{self.target}")
            except ValueError as error:
                raise EditError(f"'{self}': {error}") from error

    def number(self, name: str, default: float = 0.0) -> float:
        """A setting as a finite number.

        Raises:
            EditError: If it is none.
        """
        text = self.settings.get(name)
        if text is None:
            return default
        try:
            number = float(text)
        except ValueError:
            number = float("nan")
        if not abs(number) < float("inf"):
            raise EditError(f"'{self}': {name} is a number, not '{text}'")
        return number

    def whole_value(self) -> int:
        """The target's value as a whole number, 0 or more.

        Raises:
            EditError: If it is none.
        """
        if self.value is None or not self.value.isdecimal():
            raise EditError(
                f"'{self}': {self.target} needs a whole number, such as "
                f"{self.verb}:{self.target}=17"
            )
        return int(self.value)


def read_edits(text: str) -> tuple[EditText, ...]:
    """Reads edits joined by `;`; none from an empty text.

    Raises:
        EditError: If one does not have the form.
    """
    return tuple(read_edit(part) for part in text.split(";") if part.strip())


def read_edit(text: str) -> EditText:
    """Reads one edit.

    Raises:
        EditError: If it does not have the form.
    """
    found = _FORM.fullmatch(text.strip())
    if found is None:
        raise EditError(
            f"cannot read the edit '{text.strip()}': expected verb:target=value,name=value, "
            f"{_EXAMPLE}"
        )
    pairs = [part.split("=") for part in found["rest"].split(",") if part]
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise EditError(f"the edit '{text.strip()}' gives {name} twice")
    return EditText(
        verb=found["verb"],
        target=found["target"],
        value=found["value"],
        settings=dict(pairs),
        when=found["when"] or "",
    )
