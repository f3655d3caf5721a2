"""Does the ego go where its route is moved to? How far beside its old path it drives, from traces.

At each metre of the route the place of the edited drive is compared with that of the unedited one,
so lane changes and bends, which are in both, cancel. What is judged is the share of the shift that
was reached: 1 if the ego went all the way along, 0 if it did not care.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from di_envs.town.plan import RoutePlan
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.statistics.claim_verdict import ClaimVerdict
from leaderboard.studies.effects import Effect, effect
from leaderboard.studies.experiments import LATERAL_M, MOVED, Judgement
from leaderboard.studies.numbers import effect_numbers, span_text
from leaderboard.studies.route_place import offsets

SETTLED_M = 15.0  # of the route: by then the ego has had time to go over
LOST_M = 10.0  # so far off the route it follows nothing any more
LEAST_M = 10.0  # of route that both must have driven
FOLLOWS = 0.5  # the share from which on the ego is said to follow

Offset = tuple[str, int, str, float]  # route, seed, route hash, metres to the right of the old path


def lateral_offsets(
    before: RunRecord, after: RunRecord, plans: Mapping[str, RoutePlan]
) -> list[Offset]:
    """How far the drives of one run are to the right of another's, a mean each.

    Args:
        before: Without the edit.
        after: With it.
        plans: Routes by id.
    """
    ours = {(record.route_id, record.seed): record for record in before.scored}
    found = []
    for record in after.scored:
        unedited = ours.get((record.route_id, record.seed))
        if unedited is None:
            continue
        metres = _mean_offset(unedited, record, plans[record.route_id])
        if metres is not None:
            found.append((record.route_id, record.seed, record.route_hash, metres))
    return found


def _mean_offset(before: RouteRecord, after: RouteRecord, plan: RoutePlan) -> float | None:
    (one_m, one), (other_m, other) = offsets(before.trace, plan), offsets(after.trace, plan)
    grid = np.arange(SETTLED_M, min(one_m[-1], other_m[-1]), 1.0)
    here, there = np.interp(grid, one_m, one), np.interp(grid, other_m, other)
    follows = (np.abs(here) < LOST_M) & (np.abs(there) < LOST_M)
    if np.count_nonzero(follows) < LEAST_M:
        return None
    return float(np.mean((there - here)[follows]))


def judge_route(measured: Mapping[str, Sequence[Offset]]) -> Judgement | None:
    """What moving routing and target point does.

    Args:
        measured: Offsets by the row's edit; rows not driven are missing.

    Returns:
        None unless each of the three was driven to one side at least.
    """
    shares: dict[str, Effect] = {}
    sides: dict[str, dict[str, float | None]] = {}
    for what in MOVED:
        pooled: dict[tuple[str, int, str], list[float]] = {}
        sides[what] = {}
        for asked in (-LATERAL_M, LATERAL_M):
            found = measured.get(f"shift:{what},lateral={asked:g}", ())
            reached = [metres / asked for *_, metres in found]
            sides[what][f"{asked:g}"] = float(np.mean(reached)) if reached else None
            for (route_id, seed, route_hash, _), share in zip(found, reached, strict=True):
                pooled.setdefault((route_id, seed, route_hash), []).append(share)
        if not pooled:
            return None
        shares[what] = effect(
            [float(np.mean(each)) for each in pooled.values()],
            [world[2] for world in pooled],
            tests=len(MOVED),
            margin=FOLLOWS,
        )
    verdict = _verdict(shares)
    parts = [
        f"{what.replace('+', ' and ').replace('_', ' ')} moved by {LATERAL_M:g} m: the ego moves "
        f"over by {100 * share.mean:.0f} % of it ({span_text(share, 100.0, ' %')})"
        for what, share in shares.items()
    ]
    return Judgement(
        experiment="route",
        verdict=verdict,
        sentence="; ".join(parts),
        numbers={
            "asked_m": LATERAL_M,
            "shares": {what: effect_numbers(share) for what, share in shares.items()},
            "sides": sides,
        },
    )


def _verdict(shares: Mapping[str, Effect]) -> ClaimVerdict:
    *alone, both = (shares[what] for what in MOVED)
    if any(each.low is None or each.high is None for each in shares.values()):
        return ClaimVerdict.UNDECIDED
    follows = [each.low is not None and each.low > FOLLOWS for each in alone]
    stays = [each.high is not None and each.high < FOLLOWS for each in alone]
    if both.low is not None and both.low > FOLLOWS and all(stays):
        return ClaimVerdict.HOLDS
    if (both.high is not None and both.high < FOLLOWS) or any(follows):
        return ClaimVerdict.DOES_NOT_HOLD
    return ClaimVerdict.UNDECIDED
