"""What a page replays: each route's packed film, and its events as the player takes them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from di_envs.route_env import RouteEnv
from di_envs.rules import rules_named
from di_envs.world.event_names import EVENT_KEYS
from di_envs.world.kinds import ActorKind, EventKind
from di_envs.world.state import TICK_S
from leaderboard.pages.report_tables import (
    event_text,
    met,
    shown_events,
)
from leaderboard.records.blocks import write_block
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.film import Film, film_of
from leaderboard.replaying.replay import ReplayError, ReplayStep, replay

AGREES_M = 0.002  # a trace is written to the millimetre


@dataclass(frozen=True, kw_only=True)
class RouteFilm:
    """A route of the page: its record, and its packed film or why there is none."""

    record: RouteRecord
    block: str = ""
    problem: str = ""


def film_routes(
    run: RunRecord,
    records: Sequence[RouteRecord],
    env: RouteEnv,
    on_route: Callable[[RouteFilm], None] = lambda film: None,
) -> list[RouteFilm]:
    """Replays routes and packs what is seen; one that cannot be replayed says why.

    Args:
        run: The run.
        records: Routes of it.
        env: From `replay_env(run)`.
        on_route: Called with each as it is done.
    """
    films = []
    for record in records:
        films.append(_film_route(run, record, env))
        on_route(films[-1])
    return films


def _film_route(run: RunRecord, record: RouteRecord, env: RouteEnv) -> RouteFilm:
    if record.lost:
        return RouteFilm(record=record, problem=f"lost ({record.status}): {record.reason}")
    try:
        film = film_of(_checked(replay(run, record, env=env), record), env.config.control_dt_s)
    except ReplayError as error:
        return RouteFilm(record=record, problem=f"cannot be replayed here: {error}")
    return RouteFilm(record=record, block=write_block(film_meta(film, record), film.columns()))


def film_meta(film: Film, record: RouteRecord) -> dict[str, Any]:
    """What a page's player is to know of a film beside its columns."""
    return {
        "route": record.route_id,
        "seed": record.seed,
        "tick_s": TICK_S,
        "length_m": record.length_m,
        "kinds": [kind.name.lower() for kind in ActorKind],
        "moments": film.moments,
    }


def _checked(steps: Iterator[ReplayStep], record: RouteRecord) -> Iterator[ReplayStep]:
    """The steps of a replay, as long as they go where the record says that the ego was."""
    wanted = {row[0]: np.array(row[1:4]) for row in record.trace}
    for step in steps:
        place = wanted.pop(step.time_s, None)
        if place is not None:
            state, ego = step.view.state, step.view.ego
            here = np.array([state.x[ego], state.y[ego], state.z[ego]])
            if not np.abs(here - place).max() < AGREES_M:
                raise ReplayError(
                    f"at {step.time_s:g} s the replay is {math.dist(here, place):.3f} m from where "
                    "the record was; `driveinsight verify` says what differs"
                )
        yield step


def event_heads(record: RouteRecord, run: RunRecord) -> list[dict[str, Any]]:
    """A route's events as a page's script takes them."""
    counted = set(shown_events(record, run))
    rules = rules_named(run.rules)
    told = {*rules.infractions, *rules.endings, EventKind.SCENARIO}
    return [
        {
            "time_s": event.time_s,
            "kind": EVENT_KEYS[event.kind],
            "text": event_text(event),
            "with": met(event),
            "x": round(event.x, 2),
            "y": round(event.y, 2),
            "counts": event in counted,
            "apart": event.kind not in told,  # what other rules count, and these do not
        }
        for event in record.events
    ]
