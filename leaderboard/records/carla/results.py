"""A run as CARLA's `results.json`, in the layout of its rules; here that of Leaderboard 1.0.

Source: field names, statuses, labels and messages of the branch `leaderboard-1.0`. Its infractions
per kilometre are sums over routes of each route's own rate, not averages; our table pools instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from di_envs.rules import Rules, rules_named
from di_envs.rules.rule_set import Layout
from di_envs.world.kinds import EventKind
from leaderboard.records.carla.results_2 import carla_results_2
from leaderboard.records.carla.words import (
    KEYS,
    SCORE_LABELS,
    carla_status,
    infraction_messages,
    refused_records,
    sensors_of,
)
from leaderboard.records.claim_text import changes_of_worlds
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.scoring.score import infractions_per_km, mean_score


def carla_results(run: RunRecord) -> dict[str, Any]:
    """The content of CARLA's `results.json` for this run, as JSON values."""
    rules = rules_named(run.rules)
    return carla_results_2(run, rules) if rules.layout == Layout.V2 else _results(run, rules)


def _results(run: RunRecord, rules: Rules) -> dict[str, Any]:
    refused = refused_records(run)
    records = [_route(record, rules) for record in (*run.routes, *refused)]
    whole = _global(run.scored, records, rules) if run.scored else {}
    values, labels = _table(whole, rules) if whole else ([], [])
    return {
        "_checkpoint": {
            "global_record": whole,
            "progress": [len(records), run.planned + len(refused)],
            "records": records,
        },
        "entry_status": _entry_status(run),
        "eligible": _eligible(run),
        "sensors": sensors_of(run),
        "values": values,
        "labels": labels,
    }


def _eligible(run: RunRecord) -> bool:
    return run.complete and not (run.lost or run.refused or changes_of_worlds(run))


def _entry_status(run: RunRecord) -> str:
    if not run.complete:
        return "Finished with missing data" if run.routes else "Started"
    if run.lost:
        return "Crashed"
    if run.refused:
        return "Finished with missing data"
    if any("Agent" in record.status for record in run.routes):
        return "Finished with agent errors"
    return "Finished"


def _route(record: RouteRecord, rules: Rules) -> dict[str, Any]:
    return {
        "route_id": f"RouteScenario_{record.route_id}",
        "index": record.index,
        "status": carla_status(record),
        "infractions": infraction_messages(record, rules),
        "scores": {
            "score_route": record.score.route_completion,
            "score_penalty": record.score.infraction_score,
            "score_composed": record.score.driving_score,
        },
        "meta": {
            "duration_system": record.wall_s,
            "duration_game": record.game_s,
            "route_length": record.keypoints_m,
        },
    }


def _global(
    routes: Sequence[RouteRecord], records: Sequence[dict[str, Any]], rules: Rules
) -> dict[str, Any]:
    driving, completion, penalty = mean_score([record.score for record in routes])
    exceptions = [
        [record["route_id"], record["index"], record["status"]]
        for record in records
        if record["status"] != "Completed"
    ]
    return {
        "route_id": -1,
        "index": -1,
        "status": "Failed" if exceptions else "Completed",
        "infractions": {
            KEYS[kind][0]: math.fsum(_rate(record, kind) for record in routes)
            for kind in rules.infractions
        },
        "scores": {
            "score_route": completion,
            "score_penalty": penalty,
            "score_composed": driving,
        },
        "scores_std_dev": {
            "score_route": _deviation(routes, lambda r: r.score.route_completion),
            "score_penalty": _deviation(routes, lambda r: r.score.infraction_score),
            "score_composed": _deviation(routes, lambda r: r.score.driving_score),
        },
        "meta": {
            "total_length": math.fsum(record.keypoints_m for record in routes),
            "duration_game": math.fsum(record.game_s for record in routes),
            "duration_system": math.fsum(record.wall_s for record in routes),
            "exceptions": exceptions,
        },
    }


def _rate(record: RouteRecord, kind: EventKind) -> float:
    """Infractions of this kind per kilometre of keypoint polyline completed; 0 at RC 0."""
    count = sum(event.kind == kind for event in record.events)
    done_m = record.score.route_completion / 100.0 * record.keypoints_m
    return infractions_per_km(count, done_m)


def _deviation(routes: Sequence[RouteRecord], value: Callable[[RouteRecord], float]) -> float | str:
    """The sample standard deviation; CARLA writes the string NaN for a single route."""
    if len(routes) == 1:
        return "NaN"
    values = [value(record) for record in routes]
    mean = math.fsum(values) / len(values)
    return math.sqrt(math.fsum((x - mean) ** 2 for x in values) / (len(values) - 1))


def _table(whole: dict[str, Any], rules: Rules) -> tuple[list[str], list[str]]:
    """CARLA's twelve values, as strings with three decimals, and their labels."""
    scores, infractions = whole["scores"], whole["infractions"]
    numbers = [scores[key] for key in ("score_composed", "score_route", "score_penalty")]
    numbers += [infractions[KEYS[kind][0]] for kind in rules.infractions]
    labels = [*SCORE_LABELS, *(KEYS[kind][1] for kind in rules.infractions)]
    return [f"{number:.3f}" for number in numbers], labels
