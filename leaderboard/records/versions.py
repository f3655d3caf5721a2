"""What a result's bits depend on beside its settings: the versions of what computed it."""

from __future__ import annotations

import hashlib
import platform
import re
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import agents
from agents import AGENTS, SCHEMES
from di_envs.numerics.kernels import sources_digest

# Packages whose version can change a bit of a result
PACKAGES = ("driveinsight", "numpy", "numba", "llvmlite", "gymnasium", "highway-env", "torch")
_WORLD = "di_envs.route_env"  # it builds on all that moves or shows a world


def package_versions() -> Mapping[str, str]:
    """The versions of Python, of those packages that are installed, and of our world's sources."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found | {"world sources": sources_digest(_WORLD)}


def agent_hash(spec: str) -> str:
    """A hash of the code and the files, such as weights, that an agent's specification names."""
    parts = re.split("[:?&=]", spec)
    entry = AGENTS.get(spec) or SCHEMES.get(parts[0])
    if entry is not None:
        parts[0] = entry.entry_point.partition(":")[0]
    digest = hashlib.blake2b(digest_size=16)
    if entry is not None and entry.data and len(parts) == 1:
        parts.append(str(Path(agents.__file__).parent / entry.data))
    for part in filter(None, parts):
        for path in _files(Path(part), folders=entry is not None):
            digest.update(path.read_bytes())
    named = not parts[0].endswith(".py")  # a module, not a file that could pass for one
    if named and all(name.isidentifier() for name in parts[0].split(".")):
        digest.update(sources_digest(parts[0]).encode())
    return digest.hexdigest()


def _files(place: Path, *, folders: bool) -> list[Path]:
    """A file, or those right in a folder; none where there is neither."""
    if folders and place.is_dir():
        return sorted(path for path in place.iterdir() if path.is_file())
    return [place] if place.is_file() else []
