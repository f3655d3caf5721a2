"""One route of a run, by its id and seed, as commands are asked for it."""

from __future__ import annotations

from leaderboard.records.record import RouteRecord, RunRecord


class RouteChoiceError(Exception):
    """A route that a run does not have, or of which it knows nothing; says which ones it has."""


def chosen_route(run: RunRecord, route_id: str, seed: int) -> RouteRecord:
    """The record of a route and seed.

    Raises:
        RouteChoiceError: If the run has none, or it was lost.
    """
    for record in run.routes:
        if (record.route_id, record.seed) == (route_id, seed):
            if record.lost:
                raise RouteChoiceError(
                    f"route {route_id}, seed {seed} was lost to the machinery: {record.reason}"
                )
            return record
    ids = ", ".join(dict.fromkeys(record.route_id for record in run.routes)) or "none yet"
    seeds = ", ".join(map(str, run.seeds))
    raise RouteChoiceError(
        f"the run has no route {route_id} with seed {seed}; its routes: {ids}; its seeds: {seeds}"
    )
