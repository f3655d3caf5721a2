"""Values of JSON to frozen dataclasses and back, by annotations; all else is refused in a line.

An error names the file, the field by its dotted path, what was expected and what came:

    RUN/routes/0003.json: events[3].tick: expected a whole number, got 'soon'

A field without a default must be there and one that the dataclass does not have is refused, with
the nearest that it has. Nothing is converted: a number stays as it is spelled, so that what was
read is written again byte for byte. Enums stand in files by their names in lower case, tuples as
lists.

Why by hand: msgspec 0.22 lets unknown keys of dataclasses pass (only its own `Struct` refuses
them), turns 1 into 1.0, and names neither the value that came nor the nearest key. cattrs 26 reads
7 as "7" and "ab" as ("a", "b"), takes NaN, and would need a hook of ours for every type below.
"""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from functools import cache
from typing import Any, Literal, TypeVar, Union

from di_envs.files.json_text import JsonError, names_in, shown
from di_envs.files.names import name_hint
from di_envs.files.plain_text import one_plain_line

T = TypeVar("T")


def from_json(
    kind: type[T],
    value: Any,
    source: str,
    at: str = "",
    *,
    complete: bool = False,
    foreign: bool = False,
) -> T:
    """The dataclass, or any other annotated type, that JSON values stand for.

    Args:
        kind: A dataclass of fields that are numbers, texts, enums, tuples, mappings by name,
            dataclasses, or one of these or None.
        value: As `parsed` gives it.
        source: What errors call the file.
        at: Path of the value in it; empty for the whole.
        complete: Whether fields that have a default must be there too, as in what we write.
        foreign: Whether unknown fields are left out, as in files whose layout is not ours.

    Raises:
        JsonError: If a field is unknown, missing, of another type, or refused by its dataclass.
    """
    try:
        result: T = _Reader(complete, foreign).read(kind, value, at)
    except _RefusedError as error:
        raise JsonError(f"{': '.join(filter(None, (source, error.at)))}: {error}") from error
    return result


class _RefusedError(ValueError):
    """A value that is not what was expected, with its path."""

    def __init__(self, at: str, message: str) -> None:
        super().__init__(message)
        self.at = at


@dataclasses.dataclass(frozen=True)
class _Reader:
    complete: bool
    foreign: bool

    def read(self, kind: Any, value: Any, at: str) -> Any:
        """The value as the annotation has it."""
        if kind is Any:
            return value
        if kind in _PLAIN:
            name, fits = _PLAIN[kind]
            return value if fits(value) else _refuse(at, name, value)
        origin, parts = typing.get_origin(kind), typing.get_args(kind)
        if origin in (Union, types.UnionType):
            return self._union(parts, value, at)
        if origin is Literal:
            return _chosen({part: part for part in parts}, value, at)
        if origin is tuple:
            return self._tuple(parts, value, at)
        if origin in (Mapping, dict):
            return self._mapping(parts[1], value, at)
        if issubclass(kind, Enum):
            return _chosen({member.name.lower(): member for member in kind}, value, at)
        return self._dataclass(kind, value, at)

    def _union(self, kinds: Sequence[Any], value: Any, at: str) -> Any:
        """As the first kind that such a value may be: an error inside then says where it is."""
        for kind in kinds:
            if _may_be(kind, value):
                return self.read(kind, value, at)
        return _refuse(at, " or ".join(map(_name_of, kinds)), value)

    def _tuple(self, parts: Sequence[Any], value: Any, at: str) -> tuple[Any, ...]:
        if not isinstance(value, list | tuple):
            _refuse(at, "a list", value)
        if len(parts) == 2 and parts[1] is Ellipsis:
            parts = (parts[0],) * len(value)
        if len(value) != len(parts):
            _refuse(at, f"a list of {len(parts)}", value)
        pairs = enumerate(zip(parts, value, strict=True))
        return tuple(self.read(part, item, f"{at}[{i}]") for i, (part, item) in pairs)

    def _mapping(self, part: Any, value: Any, at: str) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            _refuse(at, "an object", value)
        return {name: self.read(part, item, _below(at, name)) for name, item in value.items()}

    def _dataclass(self, kind: Any, value: Any, at: str) -> Any:
        if not isinstance(value, Mapping):
            _refuse(at, "an object", value)
        fields = _fields(kind)
        for name in value:
            if name not in fields and not self.foreign:
                raise _RefusedError(at, f"unknown field {shown(name)}; {name_hint(name, fields)}")
        for name, (_, optional) in fields.items():
            if name not in value and (self.complete or not optional):
                raise _RefusedError(_below(at, name), f"is missing; there is {names_in(value)}")
        given = {
            name: self.read(part, value[name], _below(at, name))
            for name, (part, _) in fields.items()
            if name in value
        }
        try:
            return kind(**given)
        except (ValueError, TypeError) as error:
            raise _RefusedError(at, one_plain_line(str(error))) from error


def _is_number(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, int) and not isinstance(value, bool)


_PLAIN: Mapping[Any, tuple[str, Callable[[Any], bool]]] = types.MappingProxyType(
    {
        int: ("a whole number", lambda value: _is_number(value) and isinstance(value, int)),
        float: ("a number", _is_number),
        str: ("a text", lambda value: isinstance(value, str)),
        bool: ("true or false", lambda value: isinstance(value, bool)),
        type(None): ("null", lambda value: value is None),
    }
)


def _may_be(kind: Any, value: Any) -> bool:
    """Whether a value is of the sort of JSON that a kind is written as."""
    if kind in _PLAIN:
        return _PLAIN[kind][1](value)
    origin = typing.get_origin(kind)
    if origin is tuple:
        return isinstance(value, list | tuple)
    if origin is Literal or (isinstance(kind, type) and issubclass(kind, Enum)):
        return isinstance(value, str)
    return isinstance(value, Mapping)


def _name_of(kind: Any) -> str:
    if kind in _PLAIN:
        return _PLAIN[kind][0]
    origin = typing.get_origin(kind)
    if origin is tuple:
        return "a list"
    if origin is Literal:
        return " or ".join(map(repr, typing.get_args(kind)))
    return "a name" if isinstance(kind, type) and issubclass(kind, Enum) else "an object"


def _chosen(by_name: Mapping[str, T], value: Any, at: str) -> T:
    if isinstance(value, str) and value in by_name:
        return by_name[value]
    raise _RefusedError(at, f"unknown {shown(value)}; {name_hint(value, by_name)}")


@cache
def _fields(kind: Any) -> dict[str, tuple[Any, bool]]:
    """Of each field of a dataclass its type, and whether it has a default."""
    hints = typing.get_type_hints(kind)
    missing = dataclasses.MISSING
    return {
        field.name: (
            hints[field.name],
            field.default is not missing or field.default_factory is not missing,
        )
        for field in dataclasses.fields(kind)
    }


def _below(at: str, name: str) -> str:
    return f"{at}.{name}" if at else name


def _refuse(at: str, expected: str, value: Any) -> typing.NoReturn:
    raise _RefusedError(at, f"expected {expected}, got {shown(value)}")


def to_json(value: Any) -> Any:
    """As values that JSON has, in the order of the fields: the inverse of `from_json`."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: to_json(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, Mapping):
        return {name: to_json(item) for name, item in value.items()}
    return [to_json(item) for item in value] if isinstance(value, list | tuple) else value
