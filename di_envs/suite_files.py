"""What a suite is made of, by content: hashes of its files, and where they are, from any folder."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from di_envs.files.json_text import compact
from di_envs.files.json_values import to_json
from di_envs.suites import DATA, NO_SCENARIOS, Suite, choose_suite, shipped_or_own
from di_envs.town.loading import FROM_MAP, NO_SIGNALS, SIDECARS, SYNTHESISE

# Options of an environment that may name files
FILE_OPTIONS = ("town", "routes", "signals", "scenarios")
IN_ROUTES = "in the route file"
# What stands in place of a file without being a path, and where shipped files are
_NAMES = {"signals": (SYNTHESISE, NO_SIGNALS, *SIDECARS), "scenarios": (NO_SCENARIOS,)}
_SHIPPED = {
    "town": (DATA, ".xodr"),
    "routes": (DATA / "routes", ".xml"),
    "scenarios": (DATA / "scenarios", ".json"),
}


def suite_of(options: Mapping[str, Any]) -> Suite:
    """The suite that an environment's options choose.

    Raises:
        ValueError: As `choose_suite`.
    """
    given = {name: options.get(name) for name in FILE_OPTIONS}
    return choose_suite(options.get("suite"), **given)


def content_of(suite: Suite) -> dict[str, str]:
    """What tells a suite from any other: a hash of each thing that it is made of, read here.

    Raises:
        OSError: If a file cannot be read.
    """
    definition = {**to_json(suite), **dict.fromkeys((*FILE_OPTIONS, "description"))}
    return {
        "suite": _hash([compact(definition).encode()]),
        "town": _hash([suite.town_path.read_bytes()]),
        "signals": _signals(suite.signals),
        "routes": _hash([suite.routes_path.read_bytes()]),
        "scenarios": _scenarios(suite),
    }


def _signals(signals: str | None) -> str:
    if signals in (None, SYNTHESISE, NO_SIGNALS):
        return signals or FROM_MAP
    path = SIDECARS.get(str(signals), Path(str(signals)))
    return _hash([path.read_bytes()])


def _scenarios(suite: Suite) -> str:
    if not suite.scenario_paths:
        return NO_SCENARIOS if suite.scenarios == NO_SCENARIOS else IN_ROUTES
    files = (sorted(p.glob("*.json")) if p.is_dir() else [p] for p in suite.scenario_paths)
    return _hash(path.read_bytes() for those in files for path in those)


def _hash(parts: Iterable[bytes]) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for part in parts:
        digest.update(hashlib.blake2b(part).digest())  # their lengths are told, too
    return digest.hexdigest()


def from_anywhere(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options with the files that they name as absolute paths, good in any folder."""
    return _with_files(options, lambda path: path.absolute() if path.exists() else None)


def found_beside(options: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The options; files that are gone from where they were, if they are in a folder, there."""

    def beside(path: Path) -> Path | None:
        there = folder.absolute() / path.name
        return there if not path.exists() and there.exists() else None

    return _with_files(options, beside)


def _with_files(options: Mapping[str, Any], place: Callable[[Path], Path | None]) -> dict[str, Any]:
    """The options with other paths of files, where `place` knows one; names stay as they are."""
    placed = dict(options)
    for name in FILE_OPTIONS:
        value = options.get(name)
        if not isinstance(value, str | Path):
            continue
        parts = str(value).split(",") if name == "scenarios" else [str(value)]
        found = [_placed(part.strip(), name, place) for part in parts]
        placed[name] = ",".join(found)
    return placed


def _placed(text: str, option: str, place: Callable[[Path], Path | None]) -> str:
    path = Path(text)
    if text in _NAMES.get(option, ()):
        return text
    if option in _SHIPPED and shipped_or_own(text, *_SHIPPED[option]) != path:
        return text  # a name of what is shipped
    return str(place(path) or text)
