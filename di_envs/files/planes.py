"""Numbers as short text: bytes by significance, deflated, in base 64.

All first bytes, then all second ones, …: so zlib finds what neighbouring numbers share.
Little-endian on every machine. What is unpacked has a limit, as a kB of text can stand for a GB.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

LARGEST_BYTES = 1 << 28  # nothing of ours is longer; text that would unpack to more is refused


def to_text(data: bytes) -> str:
    """Bytes as text of base 64, deflated."""
    return base64.b64encode(zlib.compress(data, 9)).decode("ascii")


def from_text(text: str, most: int = LARGEST_BYTES) -> bytes:
    """The inverse of `to_text`.

    Args:
        text: Of base 64.
        most: Bytes that it may unpack to.

    Raises:
        ValueError: If it is damaged, cut short, followed by something, or of more bytes.
    """
    inflate = zlib.decompressobj()
    try:
        data = inflate.decompress(base64.b64decode(text, validate=True), most)
    except (binascii.Error, zlib.error, ValueError) as error:
        raise ValueError(f"packed numbers are damaged ({error})") from error
    if inflate.unconsumed_tail and not inflate.eof:
        raise ValueError(f"packed numbers are damaged: more than {most} B")
    if not inflate.eof or inflate.unused_data:
        raise ValueError("packed numbers are damaged: cut short, or followed by something else")
    return data


def to_planes(numbers: NDArray[Any]) -> bytes:
    """All first bytes of the numbers, then all second ones, …; they must be little-endian."""
    flat = np.ascontiguousarray(numbers).view(np.uint8)
    return flat.reshape(-1, numbers.dtype.itemsize).T.tobytes()


def from_planes(data: bytes, dtype: str) -> NDArray[Any]:
    """The inverse of `to_planes`: (N,) numbers.

    Raises:
        ValueError: If these are no whole numbers of that type.
    """
    size = np.dtype(dtype).itemsize
    if len(data) % size:
        raise ValueError(f"packed numbers are damaged: {len(data)} B are not {size} planes")
    planes = np.frombuffer(data, np.uint8).reshape(size, -1)
    return np.ascontiguousarray(planes.T).view(dtype)[:, 0]
