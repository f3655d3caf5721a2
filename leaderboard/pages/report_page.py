"""A run as one HTML file: tables, all infractions on the map, and a replay of each route.

The file holds everything it needs, asks for nothing else, and is readable without its script.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from string import Template
from typing import Any

from di_envs.files.whole import write_whole
from di_envs.town.town import Town
from leaderboard.pages.markup import Markup, element, joined, json_script, static_text
from leaderboard.pages.report_map import map_svg
from leaderboard.pages.report_tables import (
    event_table,
    facts_table,
    route_table,
    summary_cards,
    worst_first,
)
from leaderboard.pages.route_films import RouteFilm, event_heads, film_routes
from leaderboard.records.claim_text import NOT_ISOLATED, in_reach
from leaderboard.records.footing import footing_differences, footing_here, footing_of
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.replay import ReplayError, replay_env

PAGE_FORMAT, PAGE_VERSION = "driveinsight-report", 1
SCRIPTS = (
    *("blocks.js", "film.js", "town.js", "scene.js", "scale.js", "player.js", "transport.js"),
    *("tables.js", "overview.js", "report.js"),
)


class ReportError(Exception):
    """A page that cannot be made; the message says what to do."""


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


def report_page(run: RunRecord, films: Sequence[RouteFilm], town: Town) -> str:
    """The page's text.

    Args:
        run: The run.
        films: Its routes that the page is about.
        town: Where they lead through.
    """
    by_index = {film.record.index: film for film in films}
    records = worst_first([film.record for film in films])
    films = [by_index[record.index] for record in records]
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
    if in_reach(run):
        yield NOT_ISOLATED
    for route_id, why in run.refused.items():
        reason = why.removeprefix(f"Route '{route_id}': ")
        yield f"Route {route_id} could not be planned and is in no mean: {reason}"
    yield from run.notes
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
