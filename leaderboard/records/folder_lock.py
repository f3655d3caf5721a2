"""One run a folder: a lock that the system takes back however the process ends."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from leaderboard.records.results import ResultsError

LOCK_FILE = ".lock"


@contextmanager
def folder_lock(folder: Path) -> Iterator[None]:
    """Makes the folder and keeps other processes from writing results into it meanwhile.

    The lock's file goes with the lock. A kill leaves an unlocked file, which is as good as none.

    Raises:
        ResultsError: If another process holds it, or it cannot be made.
    """
    path = folder / LOCK_FILE
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = _locked(path)
    except BlockingIOError as error:
        raise ResultsError(
            f"another process is writing results into {folder}: wait for it, or choose another "
            "--output"
        ) from error
    except OSError as error:
        raise ResultsError(
            f"cannot write results to {folder} ({error.strerror}): choose another --output"
        ) from error
    try:
        yield
    finally:
        path.unlink(missing_ok=True)  # before it is given back: who waits for it sees that
        os.close(descriptor)


def _locked(path: Path) -> int:
    """The file's descriptor, locked; that of the file which is there, not of one just removed."""
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if path.exists() and os.path.samestat(os.fstat(descriptor), path.stat()):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)
