"""Loads towns by name or file, from the cache where they have been parsed before."""

from __future__ import annotations

import difflib
import warnings
from pathlib import Path

from di_envs.files.received import read_bytes
from di_envs.town import cache
from di_envs.town.lanes import Lanes, SignalKind
from di_envs.town.reading.crosswalks import find_crosswalks
from di_envs.town.reading.elements import decode_xml
from di_envs.town.reading.guessing import guessed_heads
from di_envs.town.reading.map_signals import heads_in_map
from di_envs.town.reading.network import build_lanes, junction_names
from di_envs.town.reading.opendrive import read_opendrive
from di_envs.town.reading.records import OpenDrive
from di_envs.town.reading.sampling import LaneGeometry
from di_envs.town.reading.sidecar import (
    enforced_limits,
    heads_of_sidecar,
    read_sidecar,
)
from di_envs.town.reading.signals import Head, assemble_signals
from di_envs.town.reading.stretches import Stretch
from di_envs.town.town import Town

_DATA = Path(__file__).resolve().parent / "data"
# Two literal tables of what is shipped.
TOWNS = {
    "town05": _DATA / "town05.xodr",
    "toy": _DATA / "toy.xodr",
}
SIDECARS = {
    "town05": _DATA / "signals" / "town05.json",
}
FROM_MAP, SYNTHESISE, NO_SIGNALS = "map", "synthesise", "none"


def load_town(
    town: str | Path,
    signals: str | Path | None = None,
    *,
    cache_folder: Path | None = None,
    cached: bool = True,
) -> Town:
    """Loads a town.

    Args:
        town: A shipped town's name ("town05", "toy") or an OpenDRIVE file.
        signals: Where signals come from. None: the map; a map that carries none gives a warning.
            "town05": the shipped sidecar for CARLA's own Town05, of any year. A file: a sidecar
            (`di_envs.town.reading.sidecar` has its format). "synthesise": a guess from the
            junctions' shapes (`di_envs.town.reading.guessing`); a warning says what it made.
            "none": there are none.
        cache_folder: Where parsed towns are kept; by default in our caches.
        cached: Whether to look there, and to keep the town there; False reads the map itself.

    Raises:
        FileNotFoundError: If there is no such file, shipped town or sidecar.
        ValueError: If the file cannot be read as a town, or the sidecar does not fit it.
    """
    path = _known_path(town, TOWNS, "OpenDRIVE file and no shipped town", ())
    source, sidecar = _signal_source(signals)
    content = _content(path)
    told = _content(sidecar) if sidecar is not None else b""
    key = cache.content_hash(content, source.encode() + b"\0" + told)
    text = decode_xml(content, str(path))
    loaded = cache.load_cached(key, path.stem, text, cache_folder) if cached else None
    if loaded is None:
        loaded = cache.freeze(_parse(path, text, source, sidecar, key))
        if cached:
            cache.store(loaded, cache_folder)
    if source == FROM_MAP and not len(loaded.signals.kind) and len(loaded.junction_names):
        warnings.warn(_no_signals_advice(path), UserWarning, stacklevel=2)
    if source == SYNTHESISE:
        warnings.warn(_what_was_guessed(path, loaded), UserWarning, stacklevel=2)
    return loaded


def _content(path: Path) -> bytes:
    try:
        return read_bytes(path)
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror or error}") from error


def _parse(path: Path, text: str, source: str, sidecar: Path | None, key: str) -> Town:
    document = read_opendrive(text, str(path))
    lanes, geometry, stretches = build_lanes(document, str(path))
    names = junction_names(document)
    heads = _heads(document, lanes, stretches, geometry, source, sidecar)
    signals, stop_line = assemble_signals(lanes, heads, len(names))
    if sidecar is not None:
        lanes = enforced_limits(lanes, read_sidecar(sidecar).speed_limits)
    return Town(
        name=path.stem,
        lanes=lanes._replace(stop_line=stop_line),
        signals=signals,
        crosswalks=find_crosswalks(document, lanes, geometry),
        road_names=tuple(road.road_id for road in document.roads),
        junction_names=names,
        geo_origin=document.geo_origin,
        content_hash=key,
        opendrive=text,
    )


def _heads(
    document: OpenDrive,
    lanes: Lanes,
    stretches: list[Stretch],
    geometry: LaneGeometry,
    source: str,
    sidecar: Path | None,
) -> list[Head]:
    if sidecar is not None:
        rules = read_sidecar(sidecar).junctions
        return heads_of_sidecar(rules, lanes, junction_names(document), str(sidecar))
    if source == FROM_MAP:
        return heads_in_map(document, lanes, stretches, geometry)
    return guessed_heads(lanes, junction_names(document)) if source == SYNTHESISE else []


def _signal_source(signals: str | Path | None) -> tuple[str, Path | None]:
    """What `signals` stands for, and the sidecar to read."""
    if signals is None:
        return FROM_MAP, None
    if isinstance(signals, str) and signals in (SYNTHESISE, NO_SIGNALS):
        return signals, None
    words = (SYNTHESISE, NO_SIGNALS)
    return "sidecar", _known_path(signals, SIDECARS, "sidecar file and no word for signals", words)


def _known_path(
    name: str | Path, shipped: dict[str, Path], what: str, words: tuple[str, ...]
) -> Path:
    if isinstance(name, str) and name in shipped:
        return shipped[name]
    path = Path(name)
    if path.is_file():
        return path
    known = (*shipped, *words)
    near = difflib.get_close_matches(str(name), known, n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"shipped: {', '.join(known)}."
    raise FileNotFoundError(f"There is no {what} '{name}'; {hint}")


def _no_signals_advice(path: Path) -> str:
    return (
        f"{path.name} carries no traffic signals, so nobody has to stop. Pass signals='town05' "
        "(for CARLA's own Town05), signals='synthesise' (a guess from the junctions' shapes), a "
        "sidecar file, or signals='none' to say that this is meant."
    )


def _what_was_guessed(path: Path, town: Town) -> str:
    kinds, junctions = town.signals.kind, len(town.junction_names)
    lit = int((town.signals.groups > 0).sum())
    lights, stops = (int((kinds == kind).sum()) for kind in (SignalKind.LIGHT, SignalKind.STOP))
    signed = len(set(town.signals.junction[kinds == SignalKind.STOP].tolist()))
    return (
        f"{path.name}: signals='synthesise' made {lights} lights at {lit} and {stops} stop signs "
        f"at {signed} of the map's {junctions} junctions, guessed from their shapes."
    )
