"""A finished run scored by other rules, from its events alone: nothing is driven."""

from __future__ import annotations

import dataclasses

from di_envs.rules import Rules
from di_envs.world.kinds import EventKind
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.records.versions import WORLD
from leaderboard.scoring.score import Progress, score_route


def rescored(run: RunRecord, rules: Rules) -> RunRecord:
    """The run as it would be had it been scored by `rules`.

    What was detected stays as it was, see `docs/rules.md`.

    Raises:
        ValueError: If there is an event of which the rules say nothing, or the run's world did not
            record all that they count.
    """
    if not records_all(run, rules):
        raise ValueError(
            f"{rules.name} counts what worlds record from version {rules.since_world} on, and this "
            f"run is of version {run.versions.get(WORLD, '0')}: drive it again with this program"
        )
    routes = tuple(rescored_route(record, rules) for record in run.routes)
    return dataclasses.replace(run, rules=rules.name, routes=routes)


def records_all(run: RunRecord, rules: Rules) -> bool:
    """Whether the run's world recorded all that these rules count."""
    return int(run.versions.get(WORLD, "0")) >= rules.since_world


def rescored_route(record: RouteRecord, rules: Rules) -> RouteRecord:
    """The route with its score and status by `rules`; one that was lost has neither."""
    if record.lost:
        return record
    kinds = [event.kind for event in record.events]
    progress = Progress(
        done_m=record.done_m,
        length_m=record.length_m,
        completed=EventKind.COMPLETED in kinds and not record.crashed,
        travelled_m=record.travelled_m,
    )
    return dataclasses.replace(
        record,
        score=score_route(record.events, progress, rules),
        status=record.status if record.crashed else rules.status(kinds),
    )
