"""CARLA's own wheel, for those tests that ask it: not what stands in for it where it is missing."""

from __future__ import annotations

import importlib
import importlib.metadata
from types import ModuleType

import pytest


def carla_wheel() -> ModuleType:
    """The module; skips the test, or the whole file, where it is not installed."""
    try:
        importlib.metadata.version("carla")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("the carla wheel (extra 'carla') is not installed", allow_module_level=True)
    return importlib.import_module("carla")
