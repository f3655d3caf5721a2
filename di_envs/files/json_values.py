"""JSON text to frozen dataclasses and back, by their annotations; all else is refused in a line.

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
import json
import math
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeVar, Union

from di_envs.files.names import name_hint
from di_envs.files.plain_text import one_plain_line
from di_envs.files.received import read_bytes

T = TypeVar("T")

LARGEST_INTEGER = 2**64  # whole numbers from here on are refused: no field of ours holds such
DEEPEST = 64  # lists and objects within one another
_LONGEST_SHOWN = 60  # characters of what came


class JsonError(ValueError):
    """Text that is not JSON, or values that are not what was expected, in one line."""


class ForeignError(JsonError):
    """Whole JSON, but of something else, or of another format version."""


# Text to values


def read_json(path: Path) -> Any:
    """The values in a file.

    Raises:
        JsonError: If it cannot be read, or is not JSON as RFC 8259 has it.
    """
    try:
        text = read_bytes(path).decode("utf-8")
    except OSError as error:
        raise JsonError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise JsonError(f"{path}: is not whole JSON: {error}") from error
    return parsed(text, str(path))


def parsed(text: str, source: str) -> Any:
    """The values that a text holds: no NaN, nothing infinite, nothing absurdly long or deep.

    Args:
        text: Of JSON.
        source: What errors call it, such as the file's path.

    Raises:
        JsonError: If it is not such text.
    """
    try:
        value = json.loads(text, parse_constant=_no_number, parse_float=_finite, parse_int=_integer)
    except (RecursionError, MemoryError):
        raise JsonError(f"{source}: is nested deeper than {DEEPEST} lists and objects") from None
    except ValueError as error:
        raise JsonError(f"{source}: is not whole JSON: {error}") from error
    if _depth(value) > DEEPEST:
        raise JsonError(f"{source}: is nested deeper than {DEEPEST} lists and objects")
    if "\\ud" in text.lower() and not _is_unicode(value):
        raise JsonError(f"{source}: is not whole JSON: half of a surrogate pair is no character")
    return value


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number of JSON")


def _finite(text: str) -> float:
    value = float(text)
    if math.isinf(value):
        raise ValueError(f"{_cut(text)} is too large a number")
    return value


def _integer(text: str) -> int:
    if len(text) > 21 or abs(int(text)) >= LARGEST_INTEGER:
        raise ValueError(f"{_cut(text)} is too large a whole number")
    return int(text)


def _is_unicode(value: Any) -> bool:
    try:
        json.dumps(value, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        return False
    return True


def _depth(value: Any) -> int:
    """How many lists and objects stand within one another."""
    depth, level = 0, [value]
    while level := [item for item in level if isinstance(item, list | dict)]:
        depth += 1
        level = [i for item in level for i in (item.values() if type(item) is dict else item)]
    return depth


def read_document(path: Path, form: str, version: int) -> dict[str, Any]:
    """What a file of ours holds beside `format` and `format_version`, which must be these.

    Raises:
        ForeignError: If it is of another format or version.
        JsonError: If it cannot be read or is not JSON.
    """
    content = read_json(path)
    if not isinstance(content, dict) or content.pop("format", None) != form:
        raise ForeignError(f"{path}: is something else (its format is not '{form}')")
    given = content.pop("format_version", None)
    if given != version:
        raise ForeignError(
            f"{path}: has format version {_shown(given)}, this program reads {version}"
        )
    return content


# Values to dataclasses


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
                raise _RefusedError(at, f"unknown field {_shown(name)}; {name_hint(name, fields)}")
        for name, (_, optional) in fields.items():
            if name not in value and (self.complete or not optional):
                raise _RefusedError(_below(at, name), f"is missing; there is {_names(value)}")
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
    raise _RefusedError(at, f"unknown {_shown(value)}; {name_hint(value, by_name)}")


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
    raise _RefusedError(at, f"expected {expected}, got {_shown(value)}")


def _shown(value: Any) -> str:
    """What came, short and in one line, as JSON calls it."""
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    if isinstance(value, Mapping):
        return f"an object with {_names(value)}"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}" if value else "an empty list"
    return _cut(repr(value))


def _names(value: Mapping[str, Any]) -> str:
    return _cut(", ".join(map(repr, list(value)[:5]))) or "nothing in it"


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}…"


# Dataclasses to text


def to_json(value: Any) -> Any:
    """As values that JSON has, in the order of the fields: the inverse of `from_json`."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: to_json(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, Mapping):
        return {name: to_json(item) for name, item in value.items()}
    return [to_json(item) for item in value] if isinstance(value, list | tuple) else value


def compact(value: Any) -> str:
    """Plain values as text without spaces. ValueError if a number is not finite."""
    return json.dumps(value, allow_nan=False, separators=(",", ":"))


def indented(value: Any) -> str:
    """Plain values as a file's text, a line a value. ValueError if a number is not finite."""
    return json.dumps(value, allow_nan=False, indent=1) + "\n"


def by_lines(values: Mapping[str, str]) -> str:
    """An object as a file's text: a line for each field, whose value is text of JSON already."""
    lines = (f" {json.dumps(name)}: {text}" for name, text in values.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def one_line(value: Any) -> str:
    """Plain values as a file's text of one line. ValueError if a number is not finite."""
    return json.dumps(value, allow_nan=False) + "\n"
