"""Messages between an exported agent's file and the process in which its policy drives.

A message is a line of JSON, and behind it the bytes of the arrays that the line names under
`arrays`: `[[name, dtype, shape], …]`. No pickles: the two may run different Pythons, and whoever
reads a pickle runs what its writer likes. The file's side of it is in
`leaderboard/exporting/carla_file.py`, which imports nothing of ours.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

LONGEST_LINE = 2**24  # bytes: the text of a map is in one


def read_message(stream: IO[bytes]) -> tuple[dict[str, Any], dict[str, NDArray[Any]]] | None:
    """The next message, its values and its arrays; None when there is no more.

    Raises:
        EOFError: If it ends within a message.
    """
    line = stream.readline(LONGEST_LINE)
    if not line:
        return None
    values = json.loads(line)
    arrays = {}
    for name, dtype, shape in values.pop("arrays", []):
        kind = np.dtype(dtype)
        size = kind.itemsize * int(np.prod(shape, dtype=np.int64))
        content = stream.read(size)
        if len(content) < size:
            raise EOFError("a message ends before its arrays do")
        arrays[name] = np.frombuffer(content, kind).reshape(shape)
    return values, arrays


def write_message(stream: IO[bytes], values: Mapping[str, Any]) -> None:
    """Sends an answer, which has no arrays."""
    stream.write(json.dumps(values).encode() + b"\n")
    stream.flush()
