"""DriveInsight in one place: its version, its command, and what the commands do as functions.

This package lies outside of those whose names another one may have: CARLA's Python API has packages
called `agents` and `leaderboard`, too. Where one of them comes first nothing of ours can be loaded;
this can, and says what to put first. It imports nothing but Python's own until it is asked.
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from typing import Any

from driveinsight.command import main

try:
    __version__ = version("driveinsight")
except PackageNotFoundError:  # a copy of the sources that nobody installed
    __version__ = "0+not.installed"


def __getattr__(name: str) -> Any:
    """What `leaderboard` offers in Python, such as `evaluate`."""
    if name.startswith("_"):
        raise AttributeError(f"module 'driveinsight' has no attribute {name!r}")
    import leaderboard

    return getattr(leaderboard, name)


def __dir__() -> list[str]:
    import leaderboard

    return sorted({*globals(), *leaderboard.__all__})


__all__ = ["__version__", "main"]
