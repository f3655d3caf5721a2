"""All that was found of responses, as values that JSON has: `responses.json`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from leaderboard.responding.by_situation import MEASURES, by_situation, moments_of
from leaderboard.responding.claims import Finding
from leaderboard.responding.drive_responses import DriveResponses
from leaderboard.responding.heads import HeadConsistency
from leaderboard.statistics.bootstrap import BootstrapInterval


def response_values(
    drives: Sequence[DriveResponses], claims: Sequence[Finding], heads: HeadConsistency | None
) -> Mapping[str, object]:
    """All the numbers, as values that JSON has."""
    return {
        "agent": drives[0].agent,
        "drives": [{"route": d.route_id, "seed": d.seed, "drive": d.drive} for d in drives],
        "moments": dict(moments_of(drives)),
        "by_situation": {
            measure: {
                group: {name: _values(cell) for name, cell in cells.items()}
                for group, cells in by_situation(drives, measure).items()
            }
            for measure in MEASURES
        },
        "claims": [
            {
                "component": each.claim.component,
                "kind": each.claim.kind,
                "when": each.claim.when,
                "sentence": each.claim.sentence,
                "source": each.claim.source,
                "moments": each.moments,
                "strength": {**_values(each.strength), "verdict": each.verdict},
                "share": {**_values(each.share), "verdict": each.share_verdict},
            }
            for each in claims
        ],
        "heads": None
        if heads is None
        else {
            "consistency": heads.heads.tolist(),
            "favourites": [list(layer) for layer in heads.favourites],
            "mean": _values(heads.mean),
            "alike": _values(heads.alike),
            "excess": _values(heads.excess),
        },
    }


def _values(interval: BootstrapInterval) -> dict[str, float | int | None]:
    value = interval.value if math.isfinite(interval.value) else None
    return {
        "value": value,
        "low": interval.low,
        "high": interval.high,
        "routes": interval.clusters,
    }
