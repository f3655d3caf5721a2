"""DriveInsight's environments: importing this registers their Gymnasium ids, and stays light.

`gym.make("DriveInsight-Town05Long-v1")` works after `import di_envs`; without it,
`gym.make("di_envs:DriveInsight-Town05Long-v1")`. Numba and the towns are loaded by the first
environment that is made.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import gymnasium

from di_envs.config import RouteEnvConfig
from di_envs.saving import EnvSnapshot, restore, save
from di_envs.shadowing import check_not_shadowed

# One literal table; a change that can move a score needs a new version number. An id of a version
# before makes the newest too, and Gymnasium says so: worlds of before are not kept.
ENVIRONMENTS = {
    "DriveInsight-Town05Long-v1": RouteEnvConfig(suite="town05_long"),
    "DriveInsight-Town05Short-v1": RouteEnvConfig(suite="town05_short"),
    "DriveInsight-Town05Tiny-v1": RouteEnvConfig(suite="town05_tiny"),
    "DriveInsight-Toy-v1": RouteEnvConfig(suite="toy"),
}

# Loaded when first asked for, as they bring Numba with them.
_LAZY = {
    "MultiEgoEnv": "di_envs.multi_ego",
    "RouteEnv": "di_envs.route_env",
    "RouteVectorEnv": "di_envs.vector_env",
    "parallel_env": "di_envs.multi_ego",
}

__all__ = [
    "ENVIRONMENTS",
    "EnvSnapshot",
    "MultiEgoEnv",
    "RouteEnv",
    "RouteEnvConfig",
    "RouteVectorEnv",
    "parallel_env",
    "restore",
    "save",
]


def _register() -> None:
    for newest, config in ENVIRONMENTS.items():
        name, version = newest.rsplit("-v", 1)
        for env_id in (f"{name}-v{number}" for number in range(int(version) + 1)):
            if env_id not in gymnasium.registry:
                gymnasium.register(
                    env_id,
                    entry_point="di_envs.route_env:RouteEnv",
                    vector_entry_point="di_envs.vector_env:RouteVectorEnv",
                    kwargs=config.changes(),
                )


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(importlib.import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'di_envs' has no attribute {name!r}; it has {', '.join(__all__)}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY})


check_not_shadowed(Path(__file__).resolve().parent.parent)
_register()
