"""Arrays as short text, without loss, so that a record can hold every control of a route.

Bytes are put by significance (all first bytes, then all second ones, …), which lets zlib find what
neighbouring numbers share, then deflated, then written in base 64. Little-endian on every machine.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

_LARGEST_BYTES = 1 << 28  # nothing of ours is longer; text that would unpack to more is refused


def pack(array: NDArray[Any], dtype: str) -> str:
    """The array's numbers as text; its shape is for the reader to know.

    Args:
        array: (N, …) numbers, all of which `dtype` must hold exactly.
        dtype: Little-endian type to write them in, such as `<f4`.

    Raises:
        ValueError: If a number would be changed.
    """
    exact = np.ascontiguousarray(array, dtype=dtype)
    if not np.array_equal(exact, array, equal_nan=exact.dtype.kind == "f"):
        raise ValueError(f"an array of {array.dtype} cannot be packed as {dtype} without loss")
    planes = exact.view(np.uint8).reshape(-1, exact.dtype.itemsize).T
    return base64.b64encode(zlib.compress(planes.tobytes(), 9)).decode("ascii")


def unpack(text: str, dtype: str, columns: int) -> NDArray[Any]:
    """The inverse of `pack`: (N, columns) numbers.

    Raises:
        ValueError: If the text is damaged, or does not fill whole rows.
    """
    size = np.dtype(dtype).itemsize
    try:
        inflate = zlib.decompressobj()
        data = inflate.decompress(base64.b64decode(text, validate=True), _LARGEST_BYTES)
    except (binascii.Error, zlib.error) as error:
        raise ValueError(f"packed numbers are damaged ({error})") from error
    if not inflate.eof or inflate.unused_data or len(data) % (size * columns):
        raise ValueError(f"packed numbers are damaged: no whole rows of {columns} in {len(data)} B")
    planes = np.frombuffer(data, np.uint8).reshape(size, -1)
    return np.ascontiguousarray(planes.T).view(dtype).reshape(-1, columns)
