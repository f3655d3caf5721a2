"""Do more drives go wrong? The share of drives in which each kind of failure happens, paired.

The Leaderboard counts driving in a wrong lane and driving off the road as one, metres outside the
route's lanes. It calls a drive blocked after a minute or more without movement, by which time a
short route has timed out, so the two count as one here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from leaderboard.statistics.claim_verdict import ClaimVerdict
from leaderboard.studies.ablation import Pairs, paired
from leaderboard.studies.effects import Effect, share_effect
from leaderboard.studies.experiments import Judgement
from leaderboard.studies.numbers import effect_numbers, span_text
from leaderboard.studies.record import Study, StudyDrive

FAILURES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "collision": ("collision_walker", "collision_vehicle", "collision_static"),
        "red light": ("red_light",),
        "wrong lane or off road": ("outside_lanes", "route_deviation"),
        "blocked or timed out": ("blocked", "timeout"),
    }
)
ANY = "any of these"
_OF_THE_MAP = ("wrong lane or off road", "blocked or timed out")
NO_INCREASE = 0.15  # fewer than that share of drives more: of no importance


def failure_effects(
    study: Study, experiment: str, failures: Sequence[str]
) -> dict[str, dict[str, Effect]]:
    """By edit and failure: how many more drives, as a share, have it than without the edit."""
    rows = [d for d in study.compared if d.row.group == experiment]
    pairs = {driven.row.edit: paired(study.baseline, driven) for driven in rows}
    tests = len(failures) * max(len(rows), 1)
    return {
        edit: {failure: _effect(each, failure, tests) for failure in failures}
        for edit, each in pairs.items()
        if each
    }


def _effect(pairs: Pairs, failure: str, tests: int) -> Effect:
    """The interval corrected for all that is looked at; the one-sided tests each by itself.

    "No increase" is claimed only if each of these tests says so, which needs no correction.
    """
    more = [has_failed(after, failure) - has_failed(before, failure) for before, after in pairs]
    routes = [before.route_hash for before, _ in pairs]
    among = share_effect(more, routes, least=-1.0, tests=tests, margin=NO_INCREASE)
    alone = share_effect(more, routes, least=-1.0, margin=NO_INCREASE)
    return replace(among, inner_low=alone.inner_low, inner_high=alone.inner_high)


def _no_increase(found: Effect) -> bool:
    """Whether an increase of any importance is ruled out."""
    return found.inner_high is not None and found.inner_high < NO_INCREASE


def has_failed(drive: StudyDrive, failure: str) -> float:
    """1 if a failure happened in a drive, else 0."""
    kinds = sum(FAILURES.values(), ()) if failure == ANY else FAILURES[failure]
    return float(any(drive.events.get(kind, 0) for kind in kinds))


def judge_map(study: Study) -> Judgement | None:
    """Whether noise on the map, or masks, leave the ego on the road and moving."""
    found = failure_effects(study, "map", _OF_THE_MAP)
    if not found:
        return None
    each = [effect for row in found.values() for effect in row.values()]
    if any(one.low is not None and one.low > 0.0 for one in each):
        verdict = ClaimVerdict.DOES_NOT_HOLD
    elif all(_no_increase(one) for one in each):
        verdict = ClaimVerdict.HOLDS
    else:
        verdict = ClaimVerdict.UNDECIDED
    return _judgement("map", verdict, found, study)


def judge_bev(study: Study) -> Judgement | None:
    """Whether masks of the BEV features make drives fail."""
    found = failure_effects(study, "bev", (*FAILURES, ANY))
    if not found:
        return None
    strongest = list(found.values())[-1][ANY]
    if strongest.low is not None and strongest.low > 0.0:
        verdict = ClaimVerdict.HOLDS
    elif _no_increase(strongest):
        verdict = ClaimVerdict.DOES_NOT_HOLD
    else:
        verdict = ClaimVerdict.UNDECIDED
    return _judgement("bev", verdict, found, study)


def _judgement(
    experiment: str, verdict: ClaimVerdict, found: Mapping[str, Mapping[str, Effect]], study: Study
) -> Judgement:
    parts = []
    for edit, row in found.items():
        count = next(iter(row.values())).pairs
        said = [
            f"{name} {100 * one.mean:+.0f} % ({span_text(one, 100.0, ' %')})"
            for name, one in row.items()
        ]
        parts.append(f"{edit}, of {count} drives: {', '.join(said)}")
    names = list(next(iter(found.values())))
    drives = study.baseline.drives
    return Judgement(
        experiment=experiment,
        verdict=verdict,
        sentence="; ".join(parts),
        numbers={
            "unedited": {
                name: sum(has_failed(drive, name) for drive in drives) / len(drives)
                for name in names
            },
            "effects": {
                edit: {name: effect_numbers(one) for name, one in row.items()}
                for edit, row in found.items()
            },
        },
    )
