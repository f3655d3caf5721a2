"""Loads towns by name or file, from the cache where they have been parsed before."""

from __future__ import annotations

import difflib
from pathlib import Path

import numpy as np

from di_envs.town import cache
from di_envs.town.lanes import Crosswalks, Signals
from di_envs.town.network import build_lanes, junction_names
from di_envs.town.opendrive import read_opendrive
from di_envs.town.town import Town

_DATA = Path(__file__).resolve().parent / "data"
# One literal table of the towns that are shipped.
TOWNS = {
    "town05": _DATA / "town05.xodr",
    "toy": _DATA / "toy.xodr",
}


def load_town(town: str | Path, signals: str | Path | None = None) -> Town:
    """Loads a town.

    Args:
        town: A shipped town's name ("town05", "toy") or an OpenDRIVE file.
        signals: Where signals come from; see `di_envs.town.signals`.

    Raises:
        FileNotFoundError: If there is no such file or shipped town.
        ValueError: If the file cannot be read as a town.
    """
    path = _town_path(town)
    content = path.read_bytes()
    key = cache.content_hash(content, str(signals))
    folder = cache.cache_folder()
    text = content.decode("utf-8", errors="replace")
    stored = cache.load_cached(key, path.stem, text, folder)
    if stored is not None:
        return stored
    document = read_opendrive(content, str(path))
    lanes, _, _ = build_lanes(document, str(path))
    names = junction_names(document)
    loaded = cache.freeze(
        Town(
            name=path.stem,
            lanes=lanes,
            signals=_no_signals(len(names)),
            crosswalks=_no_crosswalks(),
            road_names=tuple(road.road_id for road in document.roads),
            junction_names=names,
            geo_origin=document.geo_origin,
            content_hash=key,
            opendrive=text,
        )
    )
    cache.store(loaded, folder)
    return loaded


def _town_path(town: str | Path) -> Path:
    if isinstance(town, str) and town in TOWNS:
        return TOWNS[town]
    path = Path(town)
    if path.is_file():
        return path
    near = difflib.get_close_matches(str(town), TOWNS, n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"shipped towns: {', '.join(TOWNS)}."
    raise FileNotFoundError(f"No OpenDRIVE file and no shipped town '{town}'; {hint}")


def _no_signals(junctions: int) -> Signals:
    return Signals(
        kind=np.zeros(0, np.int8),
        junction=np.zeros(0, np.int32),
        group=np.zeros(0, np.int32),
        pose=np.zeros((0, 4)),
        box=np.zeros((0, 6)),
        stop_signal=np.zeros(0, np.int32),
        stop_lane=np.zeros(0, np.int32),
        stop_pose=np.zeros((0, 4)),
        stop_width_m=np.zeros(0),
        groups=np.zeros(junctions, np.int32),
    )


def _no_crosswalks() -> Crosswalks:
    return Crosswalks(
        start=np.zeros((0, 3)),
        end=np.zeros((0, 3)),
        width_m=np.zeros(0),
        crossed_start=np.zeros(1, np.int32),
        crossed_lane=np.zeros(0, np.int32),
        crossed_begin_m=np.zeros(0),
        crossed_end_m=np.zeros(0),
    )
