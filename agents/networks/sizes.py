"""Sizes of networks that come from a file: what is out of all proportion is refused by name."""

from __future__ import annotations

from typing import Any

LARGEST = 4096  # of any number that sizes a network: more is a slip, and would take all memory


def check_sizes(config: Any, *names: str) -> None:
    """Refuses sizes of which no network is made.

    Raises:
        ValueError: Names the first that is not from 1 to `LARGEST`.
    """
    for name in names:
        value = getattr(config, name)
        for size in value if isinstance(value, tuple | list) else (value,):
            if not 1 <= size <= LARGEST:
                raise ValueError(f"{name} must be from 1 to {LARGEST}, not {size}")
