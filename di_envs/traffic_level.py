"""How many others there are: what a suite says, or as many a kilometre of lanes as in Town05."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from di_envs.town.lanes import LaneKind, Lanes

TOWN05_LANES_M = 17_798.0  # driving lanes of the shipped town05, without those in junctions


@dataclass(frozen=True, kw_only=True)
class TrafficLevel:
    """How many others there are."""

    vehicles: int
    walkers: int

    def __post_init__(self) -> None:
        for name, count in dataclasses.asdict(self).items():
            if type(count) is not int or count < 0:
                raise ValueError(f"Traffic '{name}' must be a whole number >= 0, got {count!r}.")


TOWN05_TRAFFIC = TrafficLevel(vehicles=120, walkers=60)  # 120 as the Leaderboard has there


def driving_lanes_m(lanes: Lanes) -> float:
    """Length of all driving lanes but those in junctions, which lie over each other."""
    counted = (lanes.kind == LaneKind.DRIVING) & (lanes.junction < 0)
    return float(np.sum(lanes.length_m[counted]))


def usual_traffic(lanes: Lanes) -> TrafficLevel:
    """As many a kilometre of driving lanes as the shipped Town05 suites have."""
    share = driving_lanes_m(lanes) / TOWN05_LANES_M
    return TrafficLevel(
        vehicles=round(share * TOWN05_TRAFFIC.vehicles),
        walkers=round(share * TOWN05_TRAFFIC.walkers),
    )
