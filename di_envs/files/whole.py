"""Files and folders that are there whole or not at all, however a process ends.

They are written beside their place, then renamed: a reader finds the old one or the new one, and a
failure leaves nothing behind. After a kill a hidden file `.NAME.RANDOM.unfinished` may stay;
`unfinished` finds those of one file.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

UNFINISHED = ".unfinished"  # what the name of a file ends in that was not written to its end


def write_whole(path: Path, content: str | bytes | Callable[[IO[bytes]], Any]) -> None:
    """Writes a file in one step; its folder is made.

    Args:
        path: The file, new or to be replaced.
        content: Text (UTF-8), bytes, or what writes them to a binary file.

    Raises:
        OSError: If it cannot be written; what was there stays.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(
        dir=path.parent, prefix=f".{path.name}.", suffix=UNFINISHED, delete=False
    ) as file:
        try:
            _fill(file, content)
            file.flush()
            os.fsync(file.fileno())
            os.chmod(file.name, 0o644)  # temporary files are private, results are not
            os.replace(file.name, path)
        except BaseException:
            os.unlink(file.name)
            raise


def unfinished(folder: Path, name: str) -> list[Path]:
    """What killed processes left of a file that `write_whole` was to write.

    Args:
        folder: Of the file.
        name: A pattern for its whole name, as `re` has it.
    """
    # eight characters, as `tempfile` draws them
    left = re.compile(rf"\.(?:{name})\.[a-z0-9_]{{8}}{re.escape(UNFINISHED)}")
    if not folder.is_dir():
        return []
    return sorted(path for path in folder.iterdir() if left.fullmatch(path.name))


def _fill(file: IO[bytes], content: str | bytes | Callable[[IO[bytes]], Any]) -> None:
    if callable(content):
        content(file)
    else:
        file.write(content.encode() if isinstance(content, str) else content)


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """A folder to fill, that takes its place when the block ends without an error.

    Where another process was faster its folder stays, since equal recipes make equal folders.

    Args:
        folder: Its place; those above it are made.

    Yields:
        The folder to fill, beside that place.

    Raises:
        OSError: If it cannot be written, or something that is no folder stands there.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    made = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
    try:
        yield made
        made.chmod(0o755)
        try:
            os.replace(made, folder)
        except OSError:
            if not folder.is_dir():
                raise
    finally:
        shutil.rmtree(made, ignore_errors=True)
