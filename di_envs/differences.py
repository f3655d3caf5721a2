"""What differs between two sets of named values: the one comparison of settings and footings.

Whoever goes on with what an earlier process left, pairs two runs or shares out work over machines
asks this, so that all refuse the same things and say them in the same words.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Difference:
    """A value that is not the same in both; None where one has none.

    Attributes:
        name: What it is called; of a value within another, such as `options 'traffic'`.
        first: In the first, or the earlier one.
        second: In the second, or as it is now.
    """

    name: str
    first: Any
    second: Any

    @property
    def was_is(self) -> str:
        """Of two times: `seeds was 0, 1, is 0`."""
        return f"{self.name} was {_text(self.first, 'not given')}, is " + (
            _text(self.second, "not given")
        )

    @property
    def is_not(self) -> str:
        """Of two that are here: `numpy 2.4.6, not 2.3.1`."""
        return f"{self.name} {_text(self.first, 'absent')}, not {_text(self.second, 'absent')}"


def differences(
    first: Mapping[str, Any], second: Mapping[str, Any], names: Mapping[str, str] | None = None
) -> list[Difference]:
    """What is not the same in both, in the order of the first.

    A list is the same as a tuple of the same values, as it is in a file. Mappings are compared
    value by value.

    Args:
        first: Values by name.
        second: Those to hold against them.
        names: What some are called in a message, where their own name would not do.
    """
    return list(_differences(first, second, names or {}))


def _differences(
    first: Mapping[str, Any], second: Mapping[str, Any], names: Mapping[str, str]
) -> Iterator[Difference]:
    for name in dict.fromkeys((*first, *second)):
        one, other, called = first.get(name), second.get(name), names.get(name, name)
        if isinstance(one, Mapping) and isinstance(other, Mapping):
            inner = {key: f"{called} '{key}'" for key in (*one, *other)}
            yield from _differences(one, other, inner)
        elif _plain(one) != _plain(other):
            yield Difference(name=called, first=one, second=other)


def _plain(value: Any) -> Any:
    """The value with lists for all tuples in it."""
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    return value


def _text(value: Any, missing: str) -> str:
    if value is None:
        return missing
    return ", ".join(map(str, value)) or "none" if isinstance(value, tuple | list) else str(value)
