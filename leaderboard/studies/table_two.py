"""The paper's Table 2: what taking each component away did to its model, as facts.

Its model had Town05 in its training data; each row is one figure, with no interval.
Source: Li et al., Exploring the Causality of End-to-End Autonomous Driving, 2024, Table 2 (driving
score, route completion and infraction score on Town05 Short).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from leaderboard.studies.effects import EQUIVALENT, MARGIN_DS, MATTERS


@dataclass(frozen=True, kw_only=True)
class PaperRow:
    """A row: driving score 0..100, route completion 0..100, infraction score 0..1."""

    driving_score: float
    route_completion: float
    infraction_score: float

    @property
    def difference(self) -> float:
        """Of the driving score to the table's baseline."""
        return round(self.driving_score - BASELINE.driving_score, 2)

    @property
    def verdict(self) -> str:
        """By our margin: there is no interval to go by."""
        return MATTERS if abs(self.difference) > MARGIN_DS else EQUIVALENT


def _row(ds: float, rc: float, penalty: float) -> PaperRow:
    return PaperRow(driving_score=ds, route_completion=rc, infraction_score=penalty)


BASELINE = _row(95.30, 99.26, 0.96)
TABLE_2: Mapping[str, PaperRow] = MappingProxyType(
    {
        "bev": _row(51.66, 80.82, 0.66),
        "map": _row(94.55, 99.78, 0.94),
        "routing": _row(20.64, 29.03, 0.64),
        "command": _row(96.61, 99.11, 0.97),
        "target_point": _row(32.64, 47.47, 0.69),
        "speed": _row(88.61, 93.36, 0.93),
        "speed_history": _row(93.92, 99.59, 0.94),
        "obstacles": _row(94.86, 98.43, 0.95),
        "stop_signs": _row(94.91, 99.25, 0.95),
        "traffic_lights": _row(49.74, 81.60, 0.68),
    }
)
