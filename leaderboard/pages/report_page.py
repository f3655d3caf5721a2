"""A run as one HTML file: tables, all infractions on the map, and a replay of each route.

The file holds everything it needs, asks for nothing else, and is readable without its script.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from di_envs.files.whole import write_whole
from di_envs.route_env import RouteEnv
from di_envs.town.town import Town
from di_envs.world.kinds import ActorKind
from di_envs.world.state import TICK_S
from leaderboard.pages.markup import Markup, element, joined, json_script, static_text
from leaderboard.pages.report_map import map_svg
from leaderboard.pages.report_tables import (
    event_table,
    event_text,
    facts_table,
    met,
    route_table,
    shown_events,
    summary_cards,
)
from leaderboard.records.blocks import write_block
from leaderboard.records.footing import footing_differences, footing_here, footing_of
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.film import Film, film_of
from leaderboard.replaying.replay import ReplayError, ReplayStep, replay, replay_env

PAGE_FORMAT, PAGE_VERSION = "driveinsight-report", 1
SCRIPTS = (
    *("blocks.js", "film.js", "town.js", "scene.js", "player.js", "transport.js"),
    *("tables.js", "overview.js", "report.js"),
)
AGREES_M = 0.002  # a trace is written to the millimetre


class ReportError(Exception):
    """A page that cannot be made; the message says what to do."""


@dataclass(frozen=True, kw_only=True)
class RouteFilm:
    """A route of the page: its record, and its packed film or why there is none."""

    record: RouteRecord
    block: str = ""
    problem: str = ""


def chosen_routes(run: RunRecord, route_ids: Sequence[str]) -> tuple[RouteRecord, ...]:
    """The records of some routes, or of all where no id is given.

    Raises:
        ReportError: If the run has no such route, or no route at all.
    """
    known = list(dict.fromkeys(record.route_id for record in run.routes))
    if not known:
        raise ReportError("no route of the run is finished yet: there is nothing to report")
    for route_id in route_ids:
        if route_id not in known:
            raise ReportError(f"the run has no route {route_id}; it has: {', '.join(known)}")
    wanted = set(route_ids) or set(known)
    return tuple(record for record in run.routes if record.route_id in wanted)


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


def report_page(run: RunRecord, films: Sequence[RouteFilm], town: Town) -> str:
    """The page's text.

    Args:
        run: The run.
        films: Its routes that the page is about.
        town: Where they lead through.
    """
    records = [film.record for film in films]
    shown = {film.record.index for film in films if film.block}
    title = f"{run.agent} on {run.suite}"
    seeds = f"seed{'s' if len(run.seeds) > 1 else ''} {', '.join(map(str, run.seeds))}"
    return Template(static_text("report.html")).substitute(
        title=joined([title]),
        subtitle=joined([f"track {run.track} · rules {run.rules} · {run.town} · {seeds}"]),
        style=static_text("style.css"),
        notes=joined(element("p", note, class_="note") for note in _notes(run, films)),
        **player_parts(),
        cards=summary_cards(run, records),
        routes=route_table(run, records, shown),
        events=event_table(run, records, shown),
        facts=facts_table(run),
        map=map_svg(run, records, town),
        head=json_script("report", _head(run, films)),
        blocks=joined(_block(film) for film in films if film.block),
        scripts=joined(element("script", Markup("\n" + static_text(name))) for name in SCRIPTS),
    )


def player_parts() -> dict[str, str]:
    """The parts of a page that its player takes, by their names in templates."""
    names = {"stage": "stage", "aside": "now", "controls": "controls", "colours": "colours"}
    return {part: static_text(f"{name}.html") for part, name in names.items()}


def write_report(path: Path, page: str) -> int:
    """Writes the page in one step, so that there is never half of one; returns its bytes.

    Raises:
        ReportError: If it cannot be written.
    """
    data = page.encode()
    try:
        write_whole(path, data)
    except OSError as error:
        raise ReportError(
            f"cannot write {path} ({error.strerror}): choose another --output"
        ) from error
    return len(data)


def make_report(
    run: RunRecord,
    route_ids: Sequence[str] = (),
    on_route: Callable[[RouteFilm], None] = lambda film: None,
) -> tuple[str, list[RouteFilm]]:
    """Replays a run's routes and makes its page.

    Args:
        run: The run.
        route_ids: Only these; all when empty.
        on_route: Called with each as it is done.

    Raises:
        ReportError: If there is no such route, or its town is not to be had here.
    """
    records = chosen_routes(run, route_ids)
    try:
        env = replay_env(run, rules=run.rules)
    except ReplayError as error:
        raise ReportError(str(error)) from error
    films = film_routes(run, records, env, on_route)
    return report_page(run, films, env.world.town), films


def _notes(run: RunRecord, films: Sequence[RouteFilm]) -> Iterator[str]:
    """What a reader must know before the figures."""
    if not run.complete:
        yield f"Not complete: {len(run.routes)} of {run.planned} routes x seeds were driven."
    if len(films) < len(run.routes):
        yield f"This page is about {len(films)} of the {len(run.routes)} routes x seeds."
    done = dict.fromkeys(text for film in films for text in film.record.interventions)
    if done:
        yield f"With what was done to the world, or to what the agent saw: {'; '.join(done)}."
    lost = sum(film.record.lost for film in films)
    if lost:
        yield (
            f"{lost} routes were lost to the machinery and are in no mean: the same command with "
            "--resume drives them."
        )
    differences = footing_differences(footing_here(), footing_of(run))
    if differences:
        yield f"Replayed on {'; '.join(differences)} in the run: bits may differ for that alone."
    for film in films:
        if film.problem and not film.record.lost:
            yield f"Route {film.record.route_id}, seed {film.record.seed} {film.problem}."
    if len(run.seeds) == 1:
        yield f"One seed ({run.seeds[0]}): no confidence interval."


def _block(film: RouteFilm) -> Markup:
    identity = f"block-{film.record.index}"
    return element("script", Markup(film.block), type="text/plain", id=identity)


def _head(run: RunRecord, films: Sequence[RouteFilm]) -> dict[str, Any]:
    """What the script knows of the routes before it unpacks one."""
    return {
        "format": PAGE_FORMAT,
        "version": PAGE_VERSION,
        "routes": [_route_head(run, film) for film in films],
    }


def _route_head(run: RunRecord, film: RouteFilm) -> dict[str, Any]:
    record = film.record
    return {
        "block": f"block-{record.index}" if film.block else None,
        "route": record.route_id,
        "seed": record.seed,
        "status": record.status,
        "problem": film.problem,
        "driving_score": record.score.driving_score,
        "game_s": record.game_s,
        "events": event_heads(record, run),
    }


def event_heads(record: RouteRecord, run: RunRecord) -> list[dict[str, Any]]:
    """A route's events as a page's script takes them."""
    counted = set(shown_events(record, run))
    return [
        {
            "time_s": event.time_s,
            "kind": event.kind.name.lower(),
            "text": event_text(event),
            "with": met(event),
            "x": round(event.x, 2),
            "y": round(event.y, 2),
            "counts": event in counted,
        }
        for event in record.events
    ]
