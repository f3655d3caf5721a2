"""What a result's bits depend on beside its settings: the versions of what computed it."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version

# Packages whose version can change a bit of a result
PACKAGES = ("driveinsight", "numpy", "numba", "llvmlite", "gymnasium", "highway-env", "torch")


def package_versions() -> Mapping[str, str]:
    """The versions of Python and of those packages that are installed."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
