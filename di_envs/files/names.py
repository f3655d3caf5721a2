"""Unknown names are refused in one way: with the nearest known one, and with all of them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from di_envs.files.plain_text import one_plain_line

LONGEST_NAME = 200  # characters of a name that are said again


def check_name(name: object, known: Iterable[str], what: str) -> None:
    """Refuses a name that is not known.

    Raises:
        ValueError: If it is not among `known`; suggests the nearest, and lists all.
    """
    names = list(known)
    if name not in names:
        shown = one_plain_line(repr(name), LONGEST_NAME)
        raise ValueError(f"Unknown {what} {shown}; {name_hint(name, names)}.")


def name_hint(name: object, known: Iterable[str]) -> str:
    """`did you mean 'x'? known: x, y` for an unknown name."""
    names = list(known)
    near = difflib.get_close_matches(str(name), names, n=1)
    start = f"did you mean '{near[0]}'? " if near else ""
    return f"{start}known: {', '.join(names) or 'none'}"
