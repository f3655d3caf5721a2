"""Reading files that somebody else may have made: ordinary ones, of a sane size, or one refusal.

A pipe would be waited for without end, a device has none, and a few kB of a packed archive can
stand for gigabytes. Nothing here runs code: arrays are read without pickles.
"""

from __future__ import annotations

import errno
import hashlib
import io
import stat
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_BYTES = 1 << 28  # of a file: nothing of ours, and no map of CARLA's, is near it
MOST_UNPACKED = 1 << 30  # of an archive's arrays together


class ArraysError(ValueError):
    """An archive of arrays that cannot be read, in one line that names it."""


def read_bytes(path: Path, most: int = MOST_BYTES) -> bytes:
    """The content of an ordinary file.

    Args:
        path: Of the file; links are followed.
        most: Bytes that it may have.

    Raises:
        OSError: If it cannot be read, is no ordinary file, or is longer; `strerror` says which.
    """
    size = check_ordinary(path)
    if size > most:
        said = f"is too large to be one of these: {size} B, more than {most}"
        raise OSError(errno.EFBIG, said, str(path))
    return path.read_bytes()


def check_ordinary(path: Path) -> int:
    """Makes sure that a file can be read to an end; returns how many bytes it has.

    Raises:
        OSError: As `read_bytes`.
    """
    found = path.stat()
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder, not a file", str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "is no ordinary file, but a pipe or a device", str(path))
    return found.st_size


def read_arrays(path: Path, most: int = MOST_UNPACKED) -> dict[str, NDArray[Any]]:
    """The arrays of an `.npz` file by their names.

    Args:
        path: Of the file.
        most: Bytes that they may take together, unpacked.

    Raises:
        ArraysError: If there is no such file, it is cut short, garbled or no such archive, holds
            pickles, or would unpack to more.
    """
    try:
        content = read_bytes(path)
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
        if unpacked > most:
            raise ArraysError(f"{path}: unpacks to {unpacked} B, more than {most}")
        with np.load(io.BytesIO(content), allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except ArraysError:
        raise
    except OSError as error:
        raise ArraysError(f"{path}: {error.strerror or error}") from error
    except Exception as error:  # of NumPy, zipfile, zlib: whatever bytes can bring about in them
        said = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise ArraysError(f"{path}: is no whole archive of arrays ({said})") from error


def arrays_digest(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Names arrays with all that they hold."""
    digest = hashlib.blake2b(digest_size=16)
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape} ".encode() + array.tobytes())
    return digest.hexdigest()


def check_array(
    arrays: Mapping[str, NDArray[Any]],
    name: str,
    kind: str,
    shape: tuple[int | None, ...],
    *,
    finite: bool = False,
) -> NDArray[Any]:
    """An array of numbers that is there, of the kind and the shape that are expected.

    Args:
        arrays: By their names.
        name: Of the one.
        kind: Letters of NumPy's kinds that it may have, such as `iu` for whole numbers.
        shape: Its length along each axis; None for any.
        finite: Whether NaN and infinity are refused.

    Raises:
        ValueError: If it is missing or another; names it.
    """
    if name not in arrays:
        raise ValueError(f"{name}: is missing")
    array = arrays[name]
    fits = len(shape) == array.ndim and all(
        wanted in (None, given) for wanted, given in zip(shape, array.shape, strict=True)
    )
    if not fits or array.dtype.kind not in kind:
        lengths = ", ".join("any" if length is None else str(length) for length in shape)
        raise ValueError(
            f"{name}: expected an array ({lengths}) of kind '{kind}', got {array.shape} of "
            f"'{array.dtype}'"
        )
    if finite and not np.isfinite(array).all():
        raise ValueError(f"{name}: holds NaN or infinity")
    return array
