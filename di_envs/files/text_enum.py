"""An enumeration whose members are texts: `StrEnum`, which Python 3.10 does not have yet."""

from __future__ import annotations

from enum import Enum


class TextEnum(str, Enum):
    """Members that are their values wherever a text is asked for: compared, printed, in JSON."""

    def __str__(self) -> str:
        return str.__str__(self)

    def __format__(self, form: str) -> str:
        return str.__format__(self, form)
