"""JSON text to plain values and back: nothing infinite, nothing absurdly long or deep.

Errors are one line that begins with the file. What is read is written again byte for byte.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from di_envs.files.received import read_bytes

LARGEST_INTEGER = 2**64  # whole numbers from here on are refused: no field of ours holds such
DEEPEST = 64  # lists and objects within one another
_LONGEST_SHOWN = 60  # characters of what came


class JsonError(ValueError):
    """Text that is not JSON, or values that are not what was expected, in one line."""


class ForeignError(JsonError):
    """Whole JSON, but of something else, or of another format version."""


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
            f"{path}: has format version {shown(given)}, this program reads {version}"
        )
    return content


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


def shown(value: Any) -> str:
    """What came, short and in one line, as JSON calls it."""
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    if isinstance(value, Mapping):
        return f"an object with {names_in(value)}"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}" if value else "an empty list"
    return _cut(repr(value))


def names_in(value: Mapping[str, Any]) -> str:
    """The first names of an object, in one line."""
    return _cut(", ".join(map(repr, list(value)[:5]))) or "nothing in it"


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}…"
