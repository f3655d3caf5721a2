"""Ways to damage a file: values that no field expects, bytes flipped, cut and repeated."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from typing import Any

VALUES: tuple[Any, ...] = (
    *(None, True, "", [], {}, [None], [[]], {"a": 1}, -1, 0, 3, 10**9, 10**18, 1e300, -1.5),
    *("\x1b[2J", "x" * 5000, "/../../../PWN", "nan", "1e9", "\x00", "a\nb", "os.system"),
)
TEXTS: dict[str, bytes] = {
    "nothing": b"",
    "blank": b" \n\t ",
    "zeros": bytes(64),
    "brackets": b"[" * 100_000,
    "objects": b'{"a":' * 100_000,
    "elements": b"<a>" * 100_000,
    "number": b"9" * 100_000,
    "no number": b'{"format": NaN, "b": Infinity}',
    "half a pair": b'{"a": "\\ud800"}',
    "not UTF-8": b"\xff\xfe\xfd{}",
    "UTF-16": "<routes/>".encode("utf-16"),
    "odd encoding": b'<?xml version="1.0" encoding="x-none"?><routes/>',
    "quotes": b'"' * 9999,
    "entities": (
        b'<!DOCTYPE a [<!ENTITY a "aaaaaaaaaa">'
        + b"".join(b'<!ENTITY %c "%s">' % (98 + n, b"&%c;" % (97 + n) * 10) for n in range(12))
        + b"]><routes>&m;</routes>"
    ),
    "a file from outside": (
        b'<!DOCTYPE a [<!ENTITY a SYSTEM "file:///etc/passwd">]><routes>&a;</routes>'
    ),
    "archive of nothing": b"PK\x05\x06" + bytes(18),
    "half an archive": b"PK\x03\x04" + bytes(40),
    "pickle": b"cposix\nsystem\n(S'touch PWN'\ntR.",
    "edits": b"set:speed=1e999;" * 2000,
    "more edits": b"@" * 3000 + b"t>>>",
}


def places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of all values within JSON values; of lists, of the first three."""
    yield at
    if isinstance(value, dict):
        for name, item in value.items():
            yield from places(item, (*at, name))
    elif isinstance(value, list):
        for number, item in enumerate(value[:3]):
            yield from places(item, (*at, number))


def with_value(value: Any, at: tuple[Any, ...], other: Any) -> Any:
    """The JSON values with another one at a path."""
    if not at:
        return other
    changed = copy.deepcopy(value)
    inner = changed
    for key in at[:-1]:
        inner = inner[key]
    inner[at[-1]] = other
    return changed


def json_with(text: str, number: int, value: Any) -> str:
    """A file's JSON with one value replaced: that of a number, counted round."""
    content = json.loads(text)
    found = list(places(content))
    return json.dumps(with_value(content, found[number % len(found)], value))


def with_bytes(content: bytes, at: float, cut: float, put: bytes) -> bytes:
    """Bytes with others in the place of some.

    Args:
        content: The file's.
        at: Where, as a share of its length.
        cut: How much is left out, as a share of the rest, cubed: most often little.
        put: What is put there.
    """
    start = int(at * len(content))
    end = start + int(cut**3 * (len(content) - start))
    return content[:start] + put + content[end:]
