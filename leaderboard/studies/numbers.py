"""Effects as JSON values and as a few words."""

from __future__ import annotations

from typing import Any

from leaderboard.studies.effects import Effect


def effect_numbers(found: Effect) -> dict[str, Any]:
    """What a record keeps of an effect."""
    return {
        "mean": found.mean,
        "interval": [found.low, found.high],
        "one_sided_interval": [found.inner_low, found.inner_high],
        "smallest_effect": found.smallest,
        "pairs": found.pairs,
        "routes": found.routes,
    }


def span_text(found: Effect, times: float = 1.0, unit: str = "", digits: int = 0) -> str:
    """`12 … 30 %`, or that there is no interval."""
    if found.low is None or found.high is None:
        return "one route: no interval"
    low, high = times * found.low + 0.0, times * found.high + 0.0
    return f"{low:.{digits}f} … {high:.{digits}f}{unit}"
