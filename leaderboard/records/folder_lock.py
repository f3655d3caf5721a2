"""One run a folder: a lock that the system takes back however the process ends.

Where a file system has no such locks (some of Lustre and NFS), or the system none (Windows), the
run goes on without, and says so.
"""

from __future__ import annotations

import errno
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from leaderboard.records.results import ResultsError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

LOCK_FILE = ".driveinsight.lock"
_HELD = (errno.EAGAIN, errno.EACCES)
_NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, errno.EINVAL)


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
        with suppress(OSError):  # Windows removes no file that is open
            path.unlink(missing_ok=True)  # before it is given back: who waits for it sees that
        os.close(descriptor)


def _locked(path: Path) -> int:
    """The file's descriptor, locked; that of the file which is there, not of one just removed."""
    while True:
        # a link there leads to somebody else's file
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o644)
        try:
            _lock(descriptor, path.parent)
            if path.exists() and os.path.samestat(os.fstat(descriptor), path.stat()):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _lock(descriptor: int, folder: Path) -> None:
    """Locks a file by whichever call works there; warns where none does.

    Raises:
        BlockingIOError: If another process holds the lock.
    """
    calls = () if fcntl is None else (fcntl.flock, fcntl.lockf)
    for call in calls:
        try:
            call(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except OSError as error:
            if error.errno in _HELD:
                raise BlockingIOError(error.errno, error.strerror) from error
            if error.errno not in _NO_LOCKS:
                raise
    warnings.warn(
        f"there are no file locks where {folder} is: let no other command write there meanwhile",
        stacklevel=2,
    )
