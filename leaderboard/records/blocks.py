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

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from di_envs.files.json_text import compact, parsed
from di_envs.files.json_values import from_json
from di_envs.files.planes import from_planes, from_text, to_planes, to_text

_FOLDED, _PLANES = "<u4", 4  # of a difference, and its bytes
_MOST_DIFFERENCES = 8  # no column of ours has more than 2
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


@dataclass(frozen=True, kw_only=True)
class _ColumnHead:
    name: str
    count: int
    step: float
    differences: int = 2

    def __post_init__(self) -> None:
        if self.count < 0 or not 0 <= self.differences <= _MOST_DIFFERENCES:
            raise ValueError(f"column '{self.name}' has an impossible count or differences")


@dataclass(frozen=True, kw_only=True)
class _Head:
    meta: dict[str, Any]
    columns: tuple[_ColumnHead, ...]


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
    head = compact({"meta": meta, "columns": heads})
    return to_text(head.encode() + b"\n" + b"".join(bodies))


def read_block(text: str) -> tuple[dict[str, Any], dict[str, NDArray[np.float64]]]:
    """The inverse of `write_block`: what is to be known, and the columns by name.

    Raises:
        BlockError: If the text is damaged.
    """
    try:
        first, _, body = from_text(text).partition(b"\n")
        head = from_json(_Head, parsed(first.decode(), "the block's head"), "the block's head")
    except ValueError as error:
        raise BlockError(f"the block is damaged: {error}") from error
    spoken_of = _PLANES * sum(column.count for column in head.columns)
    if spoken_of != len(body):
        raise BlockError(
            f"the block is damaged: it holds {len(body)} B of numbers, its head speaks of "
            f"{spoken_of}"
        )
    columns, at = {}, 0
    for column in head.columns:
        end = at + _PLANES * column.count
        columns[column.name] = _numbers(body[at:end], column.differences) * column.step
        at = end
    return head.meta, columns


def _whole(name: str, column: Column) -> NDArray[np.int64]:
    """The column's numbers in whole steps."""
    values = np.asarray(column.values, np.float64).ravel()
    steps = np.rint(values / column.step)
    if not (np.abs(steps) < _LIMIT).all():  # NaN too
        raise BlockError(f"column '{name}' holds a number that is not within {_LIMIT} steps")
    return steps.astype(np.int64)


def _planes(whole: NDArray[np.int64], differences: int) -> bytes:
    bent = np.diff(whole, n=differences, prepend=(0,) * differences)
    return to_planes(((bent << 1) ^ (bent >> 63)).astype(_FOLDED))


def _numbers(data: bytes, differences: int) -> NDArray[np.float64]:
    folded = from_planes(data, _FOLDED)
    bent = (folded >> 1).astype(np.int64) ^ -(folded & 1).astype(np.int64)
    for _ in range(differences):
        bent = np.cumsum(bent)
    return bent.astype(np.float64)
