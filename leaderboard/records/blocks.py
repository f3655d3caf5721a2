"""Columns of numbers as one short text that a page holds and its script reads.

Numbers are rounded to a step of their own and written as differences of differences, since what
moves moves evenly (or, where they are no motion, as they are); each one's sign goes to its last bit
and its bytes to four planes (all lowest ones first), so that most bytes are zero. The whole is
deflated and put in base 64.

    base64(zlib(head + "\\n" + planes of column 1 + planes of column 2 + …))
    head = {"meta": {…}, "columns": [{"name": "ego_x", "count": 381, "step": 0.01}, …]}

`static/blocks.js` is the same reader in a browser.
"""

from __future__ import annotations

import base64
import binascii
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_PLANES = 4  # bytes of a difference
_LIMIT = 2**29  # of a number in steps: a difference of differences of such still has 32 bits


@dataclass(frozen=True, kw_only=True)
class Column:
    """Numbers (N,), and the step that they may be rounded to: no more than half of it is lost.

    Attributes:
        values: The numbers.
        step: What they are rounded to.
        differences: How often differences are taken before they are written: 2 for what moves
            evenly, 0 for what jumps, such as the cells of a picture.
    """

    values: ArrayLike
    step: float = 1.0
    differences: int = 2


class BlockError(ValueError):
    """A block that is damaged, or numbers that none can hold."""


def write_block(meta: Mapping[str, Any], columns: Mapping[str, Column]) -> str:
    """Columns and what is to be known about them, as text.

    Args:
        meta: JSON values.
        columns: By name; they may be of different lengths.

    Raises:
        BlockError: If a number is not finite, or has too many steps.
    """
    heads, bodies = [], []
    for name, column in columns.items():
        whole = _whole(name, column)
        entry = {"name": name, "count": len(whole), "step": column.step}
        if column.differences != 2:
            entry["differences"] = column.differences
        heads.append(entry)
        bodies.append(_planes(whole, column.differences))
    head = json.dumps({"meta": meta, "columns": heads}, separators=(",", ":"), allow_nan=False)
    data = head.encode() + b"\n" + b"".join(bodies)
    return base64.b64encode(zlib.compress(data, 9)).decode("ascii")


def read_block(text: str) -> tuple[dict[str, Any], dict[str, NDArray[np.float64]]]:
    """The inverse of `write_block`: what is to be known, and the columns by name.

    Raises:
        BlockError: If the text is damaged.
    """
    try:
        data = zlib.decompress(base64.b64decode(text, validate=True))
        entrytext, _, body = data.partition(b"\n")
        head = json.loads(entrytext)
    except (binascii.Error, zlib.error, ValueError) as error:
        raise BlockError(f"the block is damaged: {error}") from error
    columns, at = {}, 0
    for column in head["columns"]:
        end = at + _PLANES * column["count"]
        whole = _numbers(body[at:end], column["count"], column.get("differences", 2))
        columns[column["name"]] = whole * column["step"]
        at = end
    if at != len(body):
        raise BlockError(f"the block holds {len(body)} B of numbers, its head speaks of {at}")
    return head["meta"], columns


def _whole(name: str, column: Column) -> NDArray[np.int64]:
    """The column's numbers in whole steps."""
    values = np.asarray(column.values, np.float64).ravel()
    steps = np.rint(values / column.step)
    if not (np.abs(steps) < _LIMIT).all():  # NaN too
        raise BlockError(f"column '{name}' holds a number that is not within {_LIMIT} steps")
    return steps.astype(np.int64)


def _planes(whole: NDArray[np.int64], differences: int) -> bytes:
    bent = np.diff(whole, n=differences, prepend=(0,) * differences)
    folded = ((bent << 1) ^ (bent >> 63)).astype("<u4")
    return folded.view(np.uint8).reshape(-1, _PLANES).T.tobytes()


def _numbers(data: bytes, count: int, differences: int) -> NDArray[np.float64]:
    planes = np.frombuffer(data, np.uint8)
    if planes.size != _PLANES * count:
        raise BlockError("the block is cut short")
    folded = np.ascontiguousarray(planes.reshape(_PLANES, count).T).view("<u4")[:, 0]
    bent = (folded >> 1).astype(np.int64) ^ -(folded & 1).astype(np.int64)
    for _ in range(differences):
        bent = np.cumsum(bent)
    return bent.astype(np.float64)
