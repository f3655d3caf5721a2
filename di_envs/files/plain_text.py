"""Text from elsewhere, made harmless: for terminals and pages, and as a part of a file's name.

A record, a route file or an exception can hold any character. Some clear a screen, move a cursor,
or show what follows from right to left, so that a reader sees what is not written.
"""

from __future__ import annotations

import hashlib
import re

LONGEST = 500  # characters of an exception's text: more is no reason but a dump
_LONGEST_NAME = 80
# Controls but for newline and tab; marks of direction; separators of lines; halves of surrogate
# pairs; tags, which nobody sees
_HIDDEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff"
    "\U000e0000-\U000e007f]"
)


def plain(text: str) -> str:
    r"""The text with characters that steer a terminal or hide others spelled out: `\x1b[2J`."""
    return _HIDDEN.sub(lambda found: _spelled(ord(found[0])), text)


def one_plain_line(text: str, longest: int = LONGEST) -> str:
    """The text in one line, cut where it is longer."""
    line = plain(" ".join(text[: 4 * longest].split()))
    return line if len(line) <= longest else f"{line[: longest - 1]}…"


def file_name(text: str) -> str:
    """A name that can be part of a file's in any folder, and leads out of none.

    Letters, digits, `_`, `-` and `.` stay. Where something does not, a short hash of the whole
    keeps two texts apart.
    """
    kept = "".join(c if c.isalnum() or c in "_-." else "_" for c in text).lstrip(".")
    if kept == text and 0 < len(kept) <= _LONGEST_NAME:
        return kept
    digest = hashlib.blake2b(text.encode(errors="surrogatepass"), digest_size=4).hexdigest()
    return f"{kept[:_LONGEST_NAME]}-{digest}".lstrip("-")


def _spelled(code: int) -> str:
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
