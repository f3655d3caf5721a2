"""Observations from one process to another through memory that both map: no array is pickled.

The memory has no name, so whoever is killed leaves nothing behind. Where a system has no such
memory, arrays go the long way, in the message itself.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection
from multiprocessing.reduction import recv_handle, send_handle
from typing import Any

import numpy as np
from numpy.typing import NDArray

Layout = tuple[tuple[str, str, tuple[int, ...]], ...]  # name, type and shape of each array
_APART_BYTES = 64  # arrays begin at whole multiples of it


class Sender:
    """The side that has the arrays."""

    def __init__(self, connection: Connection, process_id: int) -> None:
        self._connection, self._process_id = connection, process_id
        self._layout: Layout | None = None
        self._views: Sequence[NDArray[Any]] = ()
        self._shared = hasattr(os, "memfd_create")

    def send(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Hands arrays over, to `Receiver.receive`."""
        if not self._shared:
            self._connection.send(dict(arrays))
            return
        layout = tuple((name, array.dtype.str, array.shape) for name, array in arrays.items())
        new = layout != self._layout
        if new:
            file = os.memfd_create("driveinsight")
            os.ftruncate(file, _bytes_of(layout))
            self._views, self._layout = _views(file, layout), layout
        for view, array in zip(self._views, arrays.values(), strict=True):
            view[...] = array
        self._connection.send(layout if new else None)
        if new:
            send_handle(self._connection, file, self._process_id)
            os.close(file)


class Receiver:
    """The side that is given them."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._names: Sequence[str] = ()
        self._views: Sequence[NDArray[Any]] = ()

    def receive(self) -> dict[str, NDArray[Any]]:
        """The arrays of the next `Sender.send`, copied: they may be kept."""
        told = self._connection.recv()
        if isinstance(told, dict):
            return told
        if told is not None:
            file = recv_handle(self._connection)
            self._names, self._views = [name for name, _, _ in told], _views(file, told)
            os.close(file)
        pairs = zip(self._names, self._views, strict=True)
        return {name: view.copy() for name, view in pairs}


def _views(file: int, layout: Layout) -> list[NDArray[Any]]:
    """The arrays of a layout, as views into a mapped file."""
    memory, offset, views = mmap.mmap(file, _bytes_of(layout)), 0, []
    for _, kind, shape in layout:
        count = int(np.prod(shape, dtype=np.int64))
        array = np.frombuffer(memory, np.dtype(kind), count, offset) if count else np.zeros(0, kind)
        views.append(array.reshape(shape))
        offset += _padded(array.nbytes)
    return views


def _bytes_of(layout: Layout) -> int:
    sizes = (np.dtype(kind).itemsize * int(np.prod(shape)) for _, kind, shape in layout)
    return max(sum(map(_padded, sizes)), 1)


def _padded(size: int) -> int:
    return -(-size // _APART_BYTES) * _APART_BYTES
