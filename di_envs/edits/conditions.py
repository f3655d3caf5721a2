"""When an edit holds: what stands behind its `@`, such as `t>5&t<9` or `junction<20m`.

t>5             from then on: game time [s]
t>5&t<9         between the two; `&` joins what must all hold
junction<20m    less than 20 m before a junction on the route, or in one
route>=50%      in the second half of the route
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from typing_extensions import Self

from di_envs.config import check_name
from di_envs.edits.text import EditError

UNITS: Mapping[str, str] = {"t": "s", "junction": "m", "route": "%"}  # of what can be asked about
_WRITTEN = {"t": "", "junction": "m", "route": "%"}  # as our own texts have them
_COMPARE: Mapping[str, Callable[[Any, Any], Any]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}
_FORM = re.compile(
    r"(?P<name>[A-Za-z_]+)(?P<sign><=|>=|<|>)(?P<number>[^<>=&%ms]+)(?P<unit>[ms%]?)"
)
_EXAMPLE = "such as @t>5, @t>5&t<9, @junction<20m or @route>=50%"


@dataclass(frozen=True, kw_only=True)
class Term:
    """One comparison."""

    name: str
    sign: str
    number: float

    def __str__(self) -> str:
        return f"{self.name}{self.sign}{number_text(self.number)}{_WRITTEN[self.name]}"


@dataclass(frozen=True, kw_only=True)
class Condition:
    """Comparisons that must all hold; without any it always does."""

    terms: tuple[Term, ...] = ()

    def __str__(self) -> str:
        return "&".join(map(str, self.terms))

    @classmethod
    def of(cls, text: str) -> Self:
        """Reads what stands behind an edit's `@`; always for an empty text.

        Raises:
            EditError: If it is no condition.
        """
        return cls(terms=tuple(_term(part, text) for part in text.split("&") if text))

    @property
    def names(self) -> frozenset[str]:
        """What it asks about."""
        return frozenset(term.name for term in self.terms)

    def holds(self, values: Mapping[str, Any]) -> Any:
        """Whether it does: a bool, or one for each world.

        Args:
            values: By name, a number or (...) numbers, one for each world.
        """
        holds: Any = True
        for term in self.terms:
            holds = holds & _COMPARE[term.sign](values[term.name], term.number)
        return holds

    def refuse_names_but(self, known: Iterable[str], where: str) -> None:
        """Refuses to ask about what nobody knows there.

        Raises:
            EditError: If it does.
        """
        names = tuple(known)
        for name in sorted(self.names - set(names)):
            raise EditError(f"'@{self}' asks for {name}; {where} only {', '.join(names)} is known")


ALWAYS = Condition()


def number_text(number: float) -> str:
    """A number as short as it can be read back: 5, not 5.0."""
    return repr(number).removesuffix(".0")


def _term(part: str, whole: str) -> Term:
    found = _FORM.fullmatch(part)
    if found is None:
        raise EditError(f"cannot read the condition '@{whole}': write it {_EXAMPLE}")
    name, unit = found["name"], found["unit"]
    try:
        check_name(name, UNITS, "condition")
        number = float(found["number"])
    except ValueError as error:
        raise EditError(
            f"cannot read the condition '@{whole}': {error} Write {_EXAMPLE}"
        ) from error
    if not abs(number) < float("inf") or unit not in ("", UNITS[name]):
        raise EditError(
            f"cannot read the condition '@{whole}': {name} is compared with a number of "
            f"{UNITS[name]}, {_EXAMPLE}"
        )
    return Term(name=name, sign=found["sign"], number=number)
