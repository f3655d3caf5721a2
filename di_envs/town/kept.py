"""What follows from a large town and takes a while to work out: kept for the next run.

A file in our caches is named by all that its value follows from: the function's source and those
it builds on, NumPy, the processor, the town with its arrays, the other arguments. So nothing stale
is ever found, and what cannot be read is worked out again. It holds arrays and JSON, no code.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Mapping
from functools import cache, wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from di_envs.files.caches import cache_folders, warn_not_kept, writable_cache
from di_envs.files.received import arrays_digest, read_arrays
from di_envs.files.whole import write_whole
from di_envs.numerics.kernels import sources_digest
from di_envs.town.once import once_a_town
from di_envs.town.town import Town

LARGE = 200  # lanes of a town; in a smaller one working it out takes no longer than reading it
_PART = "worked-out"  # of the caches
_ABOUT = "about"

_Given = ParamSpec("_Given")
_Value = TypeVar("_Value")


def kept(
    work_out: Callable[Concatenate[Town, _Given], _Value],
) -> Callable[Concatenate[Town, _Given], _Value]:
    """Lets a pure function of a town, and of more, run once for each large one on this machine.

    What it returns, as its annotation says, and the other arguments are made of arrays, named
    tuples, dataclasses, tuples, mappings, texts and numbers.
    """

    @wraps(work_out)
    def found(town: Town, *args: _Given.args, **kwargs: _Given.kwargs) -> _Value:
        if town.lanes.kind.size < LARGE:
            return work_out(town, *args, **kwargs)
        function = f"{work_out.__module__}.{work_out.__qualname__}"
        sources = f"{sources_digest(work_out.__module__)} {np.__version__}"
        given = _digest((_town_digest(town), args, kwargs))
        key = hashlib.sha256(f"{function} {sources} {given}".encode()).hexdigest()[:32]
        kind = get_type_hints(work_out)["return"]
        for folder in cache_folders(_PART):
            try:
                value: _Value = _read(folder / f"{key}.npz", key, kind)
            except (ValueError, LookupError, TypeError):
                continue
            return value
        value = work_out(town, *args, **kwargs)
        _write(key, value)
        return value

    return found


@once_a_town
def _town_digest(town: Town) -> str:
    return _digest(town)


def _digest(value: Any) -> str:
    """Names a value with all that it holds."""
    arrays: list[NDArray[Any]] = []
    rest = json.dumps(_apart(value, arrays))
    return f"{hashlib.sha256(rest.encode()).hexdigest()} {arrays_digest(_named(arrays))}"


def _named(arrays: list[NDArray[Any]]) -> dict[str, Any]:
    return {str(number): array for number, array in enumerate(arrays)}


def _write(key: str, value: Any) -> None:
    """Keeps a value, if it can be kept."""
    folder = writable_cache(_PART)
    if folder is None:
        return
    arrays: list[NDArray[Any]] = []
    rest = _apart(value, arrays)
    named = _named(arrays)
    about = json.dumps({"key": key, "digest": arrays_digest(named), "value": rest})
    named[_ABOUT] = np.array(about)
    try:
        write_whole(folder / f"{key}.npz", lambda file: np.savez(file, **named))
    except OSError as error:
        warn_not_kept(folder, error)


def _read(path: Path, key: str, kind: Any) -> Any:
    """A value as it was written.

    Raises:
        ValueError: If there is none, or the file is another one or not whole; or what goes wrong
            where one is put together of what it holds.
    """
    stored = read_arrays(path)
    about = json.loads(str(stored.pop(_ABOUT)))
    # Kernels look up numbers in these arrays unchecked, so they must be those that were written
    if about["key"] != key or about["digest"] != arrays_digest(stored):
        raise ValueError(f"{path}: holds something else")
    return _together(kind, about["value"], stored)


def _apart(value: Any, arrays: list[NDArray[Any]]) -> Any:
    """A value as JSON has it, and its arrays, which it names by their number.

    Raises:
        TypeError: If there is something in it of which nobody thought.
    """
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return [str(len(arrays) - 1), bool(value.flags.writeable)]
    if dataclasses.is_dataclass(value):
        return [_apart(getattr(value, field.name), arrays) for field in dataclasses.fields(value)]
    if isinstance(value, tuple | list):
        return [_apart(part, arrays) for part in value]
    if isinstance(value, Mapping):
        return {str(name): _apart(part, arrays) for name, part in value.items()}
    if value is None or isinstance(value, str | int | float):
        return value
    raise TypeError(f"cannot keep a {type(value).__name__} in a cache")


def _together(kind: Any, value: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    """A value of a kind, from what `_apart` made of it."""
    made, parts = get_origin(kind) or kind, get_args(kind)
    if made is np.ndarray:
        number, writeable = value
        arrays[number].flags.writeable = writeable
        return arrays[number]
    if dataclasses.is_dataclass(made) or hasattr(made, "_fields"):
        given = zip(_fields(made).items(), value, strict=True)
        return made(**{name: _together(part, each, arrays) for (name, part), each in given})
    if made is tuple:
        each_kind = [parts[0]] * len(value) if parts[1:] == (...,) else parts
        each = zip(each_kind, value, strict=True)
        return tuple(_together(part, one, arrays) for part, one in each)
    if made is Mapping:
        return {name: _together(parts[1], one, arrays) for name, one in value.items()}
    return made(value)


@cache
def _fields(made: Any) -> dict[str, Any]:
    """The fields of a dataclass or a named tuple, and the kind of each."""
    hints = get_type_hints(made)
    if dataclasses.is_dataclass(made):
        return {field.name: hints[field.name] for field in dataclasses.fields(made)}
    return {name: hints[name] for name in made._fields}
