"""Where caches are kept: written to the first place that can be, read from every place there is.

The places, in order: the folder that `DRIVEINSIGHT_CACHE` names, the user's cache folder, and a
folder of the user's own among temporary files, with a warning, as it does not last. So a container
without a home runs, and one with a warm cache that cannot be written reads it. Whatever lies in a
cache can be made anew: where there is no place at all things are made each time.
"""

from __future__ import annotations

import functools
import os
import stat
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path

from platformdirs import user_cache_path

ASKED = "DRIVEINSIGHT_CACHE"  # an environment variable: an absolute path


class CacheWarning(UserWarning):
    """Caches are not where they would last; child processes leave this to their parent."""


def cache_folders(part: str) -> tuple[Path, ...]:
    """Where a part of the caches may lie, the best place first; some may not exist.

    Args:
        part: Its name, such as `towns`; one with slashes is a folder within.
    """
    temporary = _temporary_folder()
    there = (temporary,) if temporary is not None and temporary.is_dir() else ()
    return tuple(place / part for place in (*_lasting(), *there))


def writable_cache(part: str) -> Path | None:
    """The first place where a part of the caches can be written, made if need be; None if none can.

    Warns if that is among temporary files, or nowhere.

    Args:
        part: As for `cache_folders`.
    """
    for place in _lasting():
        if _can_write(place / part):
            return place / part
    temporary = _temporary_folder(make=True)
    known = ", ".join(str(place) for place in _lasting())
    if temporary is None or not _can_write(temporary / part):
        _warn(
            f"no cache can be written ({known or 'no home folder'}): code is compiled and maps are "
            f"read anew each time; name a folder that can be written in {ASKED}"
        )
        return None
    _warn(
        f"no cache that lasts can be written ({known or 'no home folder'}): compiled code and maps "
        f"are kept in {temporary}; name a folder that can be written in {ASKED}"
    )
    return temporary / part


def warn_not_kept(folder: Path, error: OSError) -> None:
    """Says, once, that something could not be kept: the disk is full, or its like."""
    _warn(
        f"cannot write to the cache in {folder.parent} ({error.strerror}): what is missing there "
        f"is made anew each time; make room, or name another folder in {ASKED}"
    )


def _lasting() -> Iterator[Path]:
    """The places that outlast a restart; a home that is not known gives none."""
    asked = os.environ.get(ASKED)
    for place in (*([Path(asked)] if asked else []), user_cache_path("driveinsight")):
        if place.is_absolute():
            yield place
        elif asked and place == Path(asked):
            _warn(f"{ASKED} must be an absolute path, not '{asked}': it is not used")


def _can_write(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def _temporary_folder(*, make: bool = False) -> Path | None:
    """A folder among temporary files; None if others than this user could write into it.

    Compiled code is loaded from there, so one that somebody else has put there is not used.
    """
    user = os.getuid() if hasattr(os, "getuid") else "user"
    try:
        folder = Path(tempfile.gettempdir()) / f"driveinsight-{user}"
        if make:
            folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return None
    theirs = hasattr(os, "getuid") and (found.st_uid != user or found.st_mode & 0o077)
    return folder if stat.S_ISDIR(found.st_mode) and not theirs else None


@functools.cache
def _warn(text: str) -> None:
    """Once a process."""
    warnings.warn(text, CacheWarning, stacklevel=3)
