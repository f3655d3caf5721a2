"""Scores agents in closed loop under the CARLA Leaderboard's rules and records what happened.

What the commands do is there as functions, loaded when first asked for:

    import leaderboard                     # or driveinsight, which offers the same

    run = leaderboard.evaluate(MyAgent, suite="town05_tiny", seeds=3)
    run.to_dataframe()
"""

from __future__ import annotations

import importlib
from typing import Any

_OFFERED = {
    "Ablated": "leaderboard.api.ablations",
    "Branched": "leaderboard.api.branches",
    "Compared": "leaderboard.api.comparisons",
    "Page": "leaderboard.api.pages",
    "RequestError": "leaderboard.api.requests",
    "Run": "leaderboard.api.runs",
    "ablate": "leaderboard.api.ablations",
    "branch": "leaderboard.api.branches",
    "compare": "leaderboard.api.comparisons",
    "evaluate": "leaderboard.api.runs",
    "explain": "leaderboard.api.pages",
    "from_pretrained": "agents.zoo.pretrained",
    "load_run": "leaderboard.api.runs",
    "push_to_hub": "agents.zoo.pretrained",
    "report": "leaderboard.api.pages",
}

__all__ = list(_OFFERED)


def __getattr__(name: str) -> Any:
    if name in _OFFERED:
        return getattr(importlib.import_module(_OFFERED[name]), name)
    offered = ", ".join(_OFFERED)
    raise AttributeError(f"module 'leaderboard' has no attribute {name!r}; it offers {offered}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_OFFERED})
