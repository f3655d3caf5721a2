"""Which driver it is, and on which packages it rests: what results of two days are compared by.

Our own drivers declare a version, so that an edit of their text moves nothing; `tests/golden` says
when one must be raised. Weights and other people's code are told by a hash of their files.
"""

from __future__ import annotations

import hashlib
import importlib.util
import sys
from collections.abc import Collection, Sequence
from contextlib import suppress
from importlib.machinery import PathFinder
from pathlib import Path

from agents import AGENTS, POLICY_FILES, SCHEMES, AgentEntry, named, place_and_options
from agents.hub import local_folder
from agents.ownership import module_named


def agent_version(spec: str) -> str:
    """What tells the agent of a specification from others of the same name.

    `expert 1` for one of ours; `driveinsight 1, files 3f…` for one that reads files, with a hash of
    what they hold; `file 3f…` for code of others, with a hash of the file that its class is in.

    Args:
        spec: See `agents.load_agent`, which must be able to load it.
    """
    name, _ = named(spec)
    if name in AGENTS:
        entry = AGENTS[name]
        own = Path(__file__).parent / entry.data
        return _declared(name, entry, [own] if entry.data else [])
    scheme, _, place = spec.partition(":")
    if scheme == "llm":
        code = _code_of(module_named(place))
        return f"{scheme} {SCHEMES[scheme].version}, files {_hash([code])}"
    if scheme in SCHEMES:
        path, options = place_and_options(spec, place)
        said = [part for value in options.values() for part in value.split(",")]
        entry = SCHEMES[scheme]
        found = local_folder(path) if entry.data_files == POLICY_FILES else Path(path)
        return _declared(scheme, entry, [found, *map(Path, said)])
    return f"file {_hash([_code_of(spec.rpartition(':')[0])])}"


def agent_packages(spec: str, loaded: Collection[str] | None = None) -> tuple[str, ...]:
    """Packages whose version can change a bit of what the agent does, beside the world's own.

    Args:
        spec: See `agents.load_agent`.
        loaded: `loaded_packages` where such an agent was made; None where none was. Of those that
            code of others may load these count then, and those that its own files name, as some
            are loaded with the first route. One that another module loads so late is not seen.
    """
    entry = AGENTS.get(named(spec)[0]) or SCHEMES.get(spec.partition(":")[0])
    packages = entry.packages if entry is not None else OF_OTHERS
    if packages != OF_OTHERS or loaded is None:
        return packages
    text = b"".join(file.read_bytes() for file in _files_of_others(spec))
    return tuple(n for n in packages if n in loaded or _module(n).encode() in text)


# Code of others may load any of these, and does not say so
OF_OTHERS = SCHEMES["carla"].packages


def loaded_packages() -> tuple[str, ...]:
    """Those of `OF_OTHERS` that this process has loaded."""
    return tuple(name for name in OF_OTHERS if _module(name) in sys.modules)


def _module(package: str) -> str:
    return package.replace("-", "_")


def _files_of_others(spec: str) -> list[Path]:
    """Those that a specification names: code, settings, pickles; without what is not there."""
    scheme, _, place = spec.partition(":")
    if scheme in SCHEMES and scheme != "llm":
        path, options = place_and_options(spec, place)
        found = [Path(path), *map(Path, options.values())]
    else:
        found = []
        with suppress(FileNotFoundError):
            found = [_code_of(module_named(place if scheme == "llm" else spec))]
    return [file for file in found if file.is_file()]


def _declared(name: str, entry: AgentEntry, places: Sequence[Path]) -> str:
    files = [file for place in places for file in _files(place, entry)]
    return f"{name} {entry.version}" + (f", files {_hash(files)}" if files else "")


def _files(place: Path, entry: AgentEntry) -> list[Path]:
    """A file; or those of a folder that decide what the agent does; none where there is neither."""
    if place.is_dir():
        named = [place / name for name in entry.data_files] or sorted(place.iterdir())
        return [path for path in named if path.is_file()]
    return [place] if place.is_file() else []


def _code_of(place: str) -> Path:
    """The file of a module, or the file itself."""
    if place.endswith(".py"):
        return Path(place)
    found = getattr(sys.modules.get(place), "__file__", None) or _origin(place)
    if found is None:
        raise FileNotFoundError(f"there is no file of the module '{place}' to tell it by")
    return Path(found)


def _origin(place: str) -> str | None:
    """Where a module's source is, found without importing the packages that it is in."""
    top, *inner = place.split(".")
    spec, name = importlib.util.find_spec(top), top
    for part in inner:
        folders = spec.submodule_search_locations if spec is not None else None
        name = f"{name}.{part}"
        spec = PathFinder.find_spec(name, folders) if folders is not None else None
    return spec.origin if spec is not None else None


def _hash(files: Sequence[Path]) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for file in files:
        digest.update(hashlib.blake2b(file.read_bytes()).digest())  # their lengths are told, too
    return digest.hexdigest()
