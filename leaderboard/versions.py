"""What a result's bits depend on beside its settings: the versions of what computed it."""

from __future__ import annotations

import hashlib
import platform
import re
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from agents import AGENTS, SCHEMES
from di_envs.kernels import sources_digest

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
    if entry := AGENTS.get(spec) or SCHEMES.get(parts[0]):
        parts[0] = entry.entry_point.partition(":")[0]
    digest = hashlib.blake2b(digest_size=16)
    for part in parts:
        if Path(part).is_file():
            digest.update(Path(part).read_bytes())
    if all(name.isidentifier() for name in parts[0].split(".")):
        digest.update(sources_digest(parts[0]).encode())
    return digest.hexdigest()
