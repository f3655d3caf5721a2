"""A run as CARLA's `results.json` in the layout of Leaderboard 2.0 and 2.1.

Source: field names, their order, rounding, statuses and labels of the branches `leaderboard-2.x`.
As there, means are over all routes that were planned, a route not driven counting as 0 (but for
those that the machinery lost); infractions per kilometre are pooled over routes; "off-road" is the
kilometres themselves, not a rate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from di_envs.rules.rule_set import PERFECT, Rules
from di_envs.world.kinds import EventKind
from leaderboard.records.carla.words import (
    KEYS,
    SCENARIO_TIMEOUT,
    SCORE_LABELS,
    YIELD,
    carla_status,
    infraction_messages,
    refused_records,
    sensors_of,
)
from leaderboard.records.claim_text import changes_of_worlds
from leaderboard.records.record import RouteRecord, RunRecord

_DECIMALS, _SCORE_DECIMALS = 3, 6
_LEAST_KM = 0.001
_SCORES = ("score_composed", "score_route", "score_penalty")
_OFF_ROAD = KEYS[EventKind.OUTSIDE_LANES][0]


def carla_results_2(run: RunRecord, rules: Rules) -> dict[str, Any]:
    """The content of `results.json` for this run, as JSON values."""
    repetition = {seed: number for number, seed in enumerate(run.seeds)}
    everything = (*run.routes, *refused_records(run))
    records = [_route(record, repetition[record.seed], rules) for record in everything]
    whole = _global(records, run, rules) if run.scored else {}
    values, labels = _table(whole, rules) if whole else ([], [])
    status = _entry_status(run)
    return {
        "_checkpoint": {
            "global_record": whole,
            "progress": [len(records), run.planned + len(everything) - len(run.routes)],
            "records": records,
        },
        "entry_status": status,
        "eligible": status == "Finished" and not changes_of_worlds(run),
        "sensors": sensors_of(run),
        "values": values,
        "labels": labels,
    }


def _entry_status(run: RunRecord) -> str:
    if not run.complete:
        return "Started"
    if run.lost:
        return "Crashed"
    if run.refused:
        return "Invalid"
    if any("sensors were invalid" in record.status for record in run.routes):
        return "Rejected"
    return "Finished"


def _listed(rules: Rules) -> list[tuple[str, str]]:
    """(key, label) of every infraction that 2.x lists, in its order."""
    known = [KEYS[kind] for kind in rules.infractions if kind != EventKind.MIN_SPEED]
    return [*known, YIELD, SCENARIO_TIMEOUT, KEYS[EventKind.MIN_SPEED]]


def _route(record: RouteRecord, repetition: int, rules: Rules) -> dict[str, Any]:
    messages = infraction_messages(record, rules)
    infractions = {key: messages.get(key, []) for key, _ in _listed(rules)}
    score = record.score
    return {
        "index": record.index,
        "route_id": f"RouteScenario_{record.route_id}_rep{repetition}",
        "status": carla_status(record),
        "num_infractions": sum(len(texts) for texts in infractions.values()),
        "infractions": infractions,
        "scores": {
            "score_route": round(score.route_completion, _SCORE_DECIMALS),
            "score_penalty": round(score.infraction_score, _SCORE_DECIMALS),
            "score_composed": round(score.driving_score, _SCORE_DECIMALS),
        },
        "meta": {
            "route_length": round(record.length_m, _DECIMALS),
            "duration_game": round(record.game_s, _DECIMALS),
            "duration_system": round(record.wall_s, _DECIMALS),
        },
    }


def _global(
    everything: Sequence[Mapping[str, Any]], run: RunRecord, rules: Rules
) -> dict[str, Any]:
    driven = everything[: len(run.routes)]  # the rest could not be planned
    records = [record for record, kept in zip(driven, run.routes, strict=True) if not kept.lost]
    planned = run.planned - len(run.lost)
    means = {
        name: round(math.fsum(r["scores"][name] for r in records) / planned, _SCORE_DECIMALS)
        for name in _SCORES
    }
    failed = [
        [record["route_id"], record["index"], record["status"]]
        for record in everything
        if record["status"].startswith("Failed")
    ]
    flawless = all(record["status"] == PERFECT for record in records)
    return {
        "index": -1,
        "route_id": -1,
        "status": "Failed" if failed else PERFECT if flawless else "Completed",
        "infractions": _rates(records, run, rules),
        "scores_mean": means,
        "scores_std_dev": {
            name: _deviation([r["scores"][name] for r in records], means[name], planned)
            for name in _SCORES
        },
        "meta": {
            **{
                name: math.fsum(record["meta"][key] for record in records)
                for name, key in (
                    ("total_length", "route_length"),
                    ("duration_game", "duration_game"),
                    ("duration_system", "duration_system"),
                )
            },
            "exceptions": failed,
        },
    }


def _rates(records: Sequence[Mapping[str, Any]], run: RunRecord, rules: Rules) -> dict[str, float]:
    """Infractions per kilometre driven, of all routes together; off-road in kilometres."""
    driven_km = math.fsum(
        record["meta"]["route_length"] / 1000.0 * record["scores"]["score_route"] / 100.0
        for record in records
    )
    counts = {
        key: sum(len(record["infractions"][key]) for record in records) for key, _ in _listed(rules)
    }
    rates = {
        key: round(count / max(driven_km, _LEAST_KM), _DECIMALS) for key, count in counts.items()
    }
    outside_m = math.fsum(
        event.value
        for record in run.scored
        for event in record.events
        if event.kind == EventKind.OUTSIDE_LANES
    )
    return {**rates, _OFF_ROAD: round(outside_m / 1000.0, _DECIMALS)}


def _deviation(values: Sequence[float], mean: float, planned: int) -> float:
    """The sample standard deviation; 0 for a single route."""
    if planned == 1:
        return 0
    return round(math.sqrt(math.fsum((x - mean) ** 2 for x in values) / (planned - 1)), _DECIMALS)


def _table(whole: Mapping[str, Any], rules: Rules) -> tuple[list[str], list[str]]:
    """The fifteen values, as strings, and their labels."""
    numbers = [whole["scores_mean"][name] for name in _SCORES]
    numbers += [whole["infractions"][key] for key, _ in _listed(rules)]
    labels = [*SCORE_LABELS, *(label for _, label in _listed(rules))]
    return [str(number) for number in numbers], labels
