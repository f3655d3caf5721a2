"""Parsed towns in our caches, safe when several processes write at once.

A town is one `.npz` file named by a hash of all that it was made from: the map, its signals and the
reader's own source, so that an edited reader never finds what another one left. A file that cannot
be read is no error: the town is parsed again and the file replaced.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from di_envs.files.caches import cache_folders, warn_not_kept, writable_cache
from di_envs.files.json_text import parsed
from di_envs.files.json_values import from_json
from di_envs.files.received import arrays_digest, read_arrays
from di_envs.files.whole import write_whole
from di_envs.town.lanes import Crosswalks, Lanes, Signals
from di_envs.town.town import Town

_PART = "towns"  # of the caches
# The modules that decide what a town's arrays hold; a test compares them with what is imported.
READER_MODULES = (
    "cache",
    "lanes",
    "loading",
    "queries",
    "reading.arms",
    "reading.borders",
    "reading.conflicts",
    "reading.crosswalks",
    "reading.elements",
    "reading.guessing",
    "reading.lane_sections",
    "reading.links",
    "reading.map_signals",
    "reading.network",
    "reading.opendrive",
    "reading.records",
    "reading.reference_line",
    "reading.sampling",
    "reading.sidecar",
    "reading.signals",
    "reading.stretches",
    "town",
)


@dataclass(frozen=True, kw_only=True)
class _About:
    """What a file holds beside arrays."""

    key: str
    digest: str  # of the arrays
    road_names: tuple[str, ...]
    junction_names: tuple[str, ...]
    geo_origin: tuple[float, float]


def reader_version() -> str:
    """A hash of the reader's own source: another reader may read otherwise."""
    digest = hashlib.sha256()
    for name in READER_MODULES:
        path = Path(__file__).parent.joinpath(*name.split(".")).with_suffix(".py")
        digest.update(name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def content_hash(opendrive: bytes, signals: bytes) -> str:
    """The identity of a town: its OpenDRIVE file and its signals, whoever reads them."""
    digests = b"".join(hashlib.sha256(part).digest() for part in (opendrive, signals))
    return hashlib.sha256(digests).hexdigest()[:32]


def cache_key(town_hash: str) -> str:
    """What the file of a town is called: the town, as this reader reads it."""
    return hashlib.sha256(f"{town_hash} {reader_version()}".encode()).hexdigest()[:32]


def load_cached(
    town_hash: str, name: str, opendrive: str, folder: Path | None = None
) -> Town | None:
    """The town of a `content_hash`, or None where there is no readable one.

    Args:
        town_hash: Of the town.
        name: What the town is to be called.
        opendrive: Its OpenDRIVE text.
        folder: Where to look; None for all places of our caches.
    """
    folders = cache_folders(_PART) if folder is None else (folder,)
    found = (_loaded(town_hash, name, opendrive, place) for place in folders)
    return next((town for town in found if town is not None), None)


def _loaded(town_hash: str, name: str, opendrive: str, folder: Path) -> Town | None:
    key = cache_key(town_hash)
    path = folder / f"{key}.npz"
    try:
        stored = read_arrays(path)
        about = from_json(_About, parsed(str(stored.pop("about")), str(path)), str(path))
        arrays = {
            part: kind(**{field: _frozen(stored[f"{part}.{field}"]) for field in kind._fields})
            for part, kind in _PARTS.items()
        }
    except (ValueError, KeyError):
        return None
    # Kernels look up numbers in these arrays unchecked, so they must be those that were written
    if about.key != key or about.digest != arrays_digest(stored):
        return None
    return Town(
        name=name,
        road_names=about.road_names,
        junction_names=about.junction_names,
        geo_origin=about.geo_origin,
        content_hash=town_hash,
        opendrive=opendrive,
        **arrays,
    )


_PARTS: dict[str, Any] = {"lanes": Lanes, "signals": Signals, "crosswalks": Crosswalks}


def store(town: Town, folder: Path | None = None) -> None:
    """Writes a town for later; a cache folder that cannot be written is not an error.

    Args:
        town: The town.
        folder: Where to; None for our caches.
    """
    place = writable_cache(_PART) if folder is None else folder
    if place is None:
        return
    key = cache_key(town.content_hash)
    arrays = {
        f"{part}.{field}": value
        for part in _PARTS
        for field, value in getattr(town, part)._asdict().items()
    }
    about = {
        "key": key,
        "digest": arrays_digest(arrays),
        "road_names": town.road_names,
        "junction_names": town.junction_names,
        "geo_origin": town.geo_origin,
    }
    try:
        write_whole(
            place / f"{key}.npz",
            lambda file: np.savez(file, about=np.array(json.dumps(about)), **arrays),
        )
    except OSError as error:
        warn_not_kept(place, error)


def freeze(town: Town) -> Town:
    """The same town; its arrays can no longer be written."""
    for part in _PARTS:
        for array in getattr(town, part):
            array.flags.writeable = False
    return town


def _frozen(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array
