"""The paper's sentences about responses, as tests that hold, do not hold, or stay open.

A sentence says that a component responds more in a situation ("when the vehicle passes through an
intersection, the model is more sensitive to traffic lights"), or that it stands out there. Each
becomes a ratio of two means over moments, with a bootstrap interval over routes:

    rises         mean strength in the situation / mean strength in all other moments
    stands out    mean strength in the situation / that of the mean component in the same moments

It **holds** if the whole interval lies above 1, and **does not hold** if it lies below `SLIGHT`, so
that a rise worth the name is ruled out; else it is **undecided**. The intervals are widened so that
all together have the level of one (Bonferroni). Beside the strength, which is what the paper looks
at, stands the share of all components' strength: where everything rises, as it does at speed, the
strength of each says little.

Source: the paper, section 4.2.3 and the appendix's cases; paraphrased.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from leaderboard.responding.drive_responses import DriveResponses
from leaderboard.statistics.bootstrap import (
    BootstrapInterval,
    cluster_sums,
    pooled_ratio_interval,
)
from leaderboard.statistics.claim_verdict import ClaimVerdict, verdict_of_interval

LEVEL = 0.95  # of all claims together
SLIGHT = 1.1  # a rise of less than a tenth is none
RISES, STANDS_OUT = "rises", "stands out"


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A sentence of the paper on one component.

    Attributes:
        component: Of which it speaks.
        kind: `RISES` or `STANDS_OUT`.
        during: Situations that all hold.
        without: Situations that must not.
        sentence: What the paper says, paraphrased.
        source: Where.
    """

    component: str
    kind: str
    during: tuple[str, ...]
    without: tuple[str, ...] = ()
    sentence: str
    source: str

    @property
    def when(self) -> str:
        """`stop_sign, not junction`."""
        return ", ".join((*self.during, *(f"not {name}" for name in self.without)))

    def moments(self, drive: DriveResponses) -> NDArray[np.bool_]:
        """(N,) at which moments of a drive it speaks."""
        holds = np.ones(len(drive.time_s), bool)
        for name in self.during:
            holds &= drive.holding(name)
        for name in self.without:
            holds &= ~drive.holding(name)
        return holds


_TEXT, _CASE_1, _CASE_2 = "section 4.2.3", "appendix, case 1", "appendix, case 2"
_JUNCTION = "passing an intersection, the model is more sensitive to traffic lights and stop signs"
_OBSTACLE = "with an obstacle in front, it is more sensitive to obstacles and routing"
_TURN = "turning, command, routing and map matter more"
_BEV = "BEV features respond strongly in many scenes, such as turning and obstacle avoidance"
_RIGHT = "turning right, routing, command and target point respond most"
_CURVE = "with obstacles in the curve, obstacles and BEV respond more"
_STOP = "nearing a stop line that is not at an intersection, beside the stop sign speed responds"
_PEAK = "the response of the map peaks in intersections and curves"


def _claim(
    component: str, kind: str, during: str, sentence: str, source: str, without: str = ""
) -> Claim:
    return Claim(
        component=component,
        kind=kind,
        during=tuple(during.split()),
        without=tuple(without.split()),
        sentence=sentence,
        source=source,
    )


# The paper does not say where passing an intersection begins: the first sentence is read in two
# ways, inside of it and with its stop line ahead
CLAIMS = (
    _claim("traffic_lights", RISES, "junction", _JUNCTION, _TEXT),
    _claim("stop_signs", RISES, "junction", _JUNCTION, _TEXT),
    _claim("traffic_lights", RISES, "light", _JUNCTION, _TEXT),
    _claim("stop_signs", RISES, "stop_sign", _JUNCTION, _TEXT),
    _claim("obstacles", RISES, "obstacle", _OBSTACLE, _TEXT),
    _claim("routing", RISES, "obstacle", _OBSTACLE, _TEXT),
    _claim("command", RISES, "turning", _TURN, _TEXT),
    _claim("routing", RISES, "turning", _TURN, _TEXT),
    _claim("map", RISES, "turning", _TURN, _TEXT),
    _claim("bev", STANDS_OUT, "turning", _BEV, _TEXT),
    _claim("bev", STANDS_OUT, "obstacle", _BEV, _TEXT),
    _claim("routing", STANDS_OUT, "turning", _RIGHT, _CASE_1),
    _claim("command", STANDS_OUT, "turning", _RIGHT, _CASE_1),
    _claim("target_point", STANDS_OUT, "turning", _RIGHT, _CASE_1),
    _claim("obstacles", RISES, "turning obstacle", _CURVE, _CASE_1),
    _claim("bev", RISES, "turning obstacle", _CURVE, _CASE_1),
    _claim("stop_signs", RISES, "stop_sign", _STOP, _CASE_2, without="junction"),
    _claim("speed", RISES, "stop_sign", _STOP, _CASE_2, without="junction"),
    _claim("map", RISES, "junction", _PEAK, _CASE_2),
)


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A claim and what was found.

    Attributes:
        claim: The claim.
        strength: The ratio of strengths.
        share: The ratio of shares.
        moments: How many moments it rests on.
    """

    claim: Claim
    strength: BootstrapInterval
    share: BootstrapInterval
    moments: int

    @property
    def verdict(self) -> ClaimVerdict:
        """On the strength, as the paper means it."""
        return verdict_on(self.strength)

    @property
    def share_verdict(self) -> ClaimVerdict:
        """On the share."""
        return verdict_on(self.share)


def verdict_on(ratio: BootstrapInterval) -> ClaimVerdict:
    """What an interval of a ratio says of "more"."""
    return verdict_of_interval(ratio.low, ratio.high, holds_above=1.0, fails_below=SLIGHT)


def examined(drives: Sequence[DriveResponses]) -> tuple[Finding, ...]:
    """Every claim on a component that the policy has, put to the test.

    Args:
        drives: Of one policy, with the same components.

    Raises:
        ValueError: If there is none, or their components differ.
    """
    groups = common_groups(drives)
    claims = [claim for claim in CLAIMS if claim.component in groups]
    tail = (1.0 - LEVEL) / max(len(claims), 1) / 2.0
    return tuple(
        Finding(
            claim=claim,
            strength=_ratio(claim, drives, "strength", tail),
            share=_ratio(claim, drives, "share", tail),
            moments=sum(int(claim.moments(drive).sum()) for drive in drives),
        )
        for claim in claims
    )


def common_groups(drives: Sequence[DriveResponses]) -> tuple[str, ...]:
    """The components of all drives.

    Raises:
        ValueError: If there is no drive, or they differ.
    """
    found = {drive.groups for drive in drives}
    if len(found) != 1:
        raise ValueError(f"expected drives of one policy, with the same components, not {found}")
    return found.pop()


def _ratio(
    claim: Claim, drives: Sequence[DriveResponses], measure: str, tail: float
) -> BootstrapInterval:
    over, under = [], []
    for drive in drives:
        values = getattr(drive, measure)  # (N, G)
        own = values[:, drive.groups.index(claim.component)]
        holds = claim.moments(drive)
        over.append((own[holds].sum(), holds.sum()))
        if claim.kind == RISES:
            under.append((own[~holds].sum(), (~holds).sum()))
        else:
            under.append((values[holds].mean(axis=1).sum(), holds.sum()))
    routes = [drive.route_hash for drive in drives]
    return pooled_ratio_interval(
        cluster_sums(np.array(over, float), routes),
        cluster_sums(np.array(under, float), routes),
        tail,
    )
