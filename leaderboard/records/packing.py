"""Arrays as short text, without loss, so that a record can hold every control of a route."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.files.planes import from_planes, from_text, to_planes, to_text


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
    return to_text(to_planes(exact))


def unpack(text: str, dtype: str, columns: int) -> NDArray[Any]:
    """The inverse of `pack`: (N, columns) numbers.

    Raises:
        ValueError: If the text is damaged, or does not fill whole rows.
    """
    numbers = from_planes(from_text(text), dtype)
    if len(numbers) % columns:
        raise ValueError(
            f"packed numbers are damaged: no whole rows of {columns} in {len(numbers)}"
        )
    return numbers.reshape(-1, columns)
