"""What a result's bits depend on beside its settings: the versions of what computed it."""

from __future__ import annotations

import platform
from collections.abc import Collection, Mapping
from importlib.metadata import PackageNotFoundError, version

from agents.versions import agent_packages
from di_envs.world_version import WORLD_VERSION

# Packages whose version can change a bit of any world or observation
PACKAGES = ("numpy", "numba", "llvmlite", "gymnasium")
WORLD = "world"  # beside them, what our own world is called
INFORMATION = ("python", "driveinsight")  # written down, and no obstacle


def package_versions(agent: str = "", loaded: Collection[str] | None = None) -> Mapping[str, str]:
    """Versions of Python, of our world, and of the packages that there are of those that count.

    Args:
        agent: Specification of the agent that drives; empty where nobody but the world does.
        loaded: What one of that specification has loaded; None where that is not known.
    """
    found = {"python": platform.python_version()}
    packages = (*PACKAGES, *(agent_packages(agent, loaded) if agent else ()))
    for package in ("driveinsight", *packages):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found | {WORLD: str(WORLD_VERSION)}
