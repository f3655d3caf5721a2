"""A run's tables as HTML: the routes, every infraction with its place, and what they rest on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from di_envs.rules import rules_named
from di_envs.world.event_names import EVENT_KEYS
from di_envs.world.kinds import EventKind
from leaderboard.pages.markup import Cell, Content, Heading, Markup, TableOf, element, joined
from leaderboard.records.claim_text import asked_for
from leaderboard.records.record import EventRecord, RouteRecord, RunRecord
from leaderboard.scoring.names import EVENT_NAMES, SCENARIO_NAMES
from leaderboard.statistics.confidence import mean_interval
from leaderboard.tables.run_tables import (
    mean_bound,
    plain_status,
    scored_per_km,
    seed_means,
    summary,
)

ROUTE_HEADINGS = (
    Heading(name="route"),
    Heading(name="seed", number=True),
    Heading(name="DS", number=True, note="driving score, percent: RC x IS"),
    Heading(name="RC", number=True, note="route completion, percent"),
    Heading(name="IS", number=True, note="infraction score, 0 to 1"),
    Heading(
        name="bound",
        number=True,
        note="DS, percent, of a perfect driver on empty roads with the same lights, in the time",
    ),
    Heading(name="infr./km", number=True, note="infractions that lower IS, a kilometre driven"),
    Heading(name="km", number=True, note="driven, of the route's length"),
    Heading(name="time [s]", number=True, note="game time"),
    Heading(name="status"),
    Heading(name="infractions"),
    Heading(name="scenarios", note="the Leaderboard's number, and how many began"),
)
EVENT_HEADINGS = (
    Heading(name="route"),
    Heading(name="seed", number=True),
    Heading(name="time [s]", number=True, note="game time"),
    Heading(name="infraction"),
    Heading(name="with"),
    Heading(name="place x, y [m]", note="in the world frame"),
)


def worst_first(records: Sequence[RouteRecord]) -> list[RouteRecord]:
    """Lost routes, then those of the lowest driving score: what a reader is to look at first."""
    return sorted(records, key=lambda r: (not r.lost, r.score.driving_score, r.index))


def event_text(event: EventRecord) -> str:
    """What happened, in words."""
    if event.kind == EventKind.SCENARIO:
        number = f"{event.value:.0f}"
        return f"scenario S{number}: {SCENARIO_NAMES.get(number, 'begins')}"
    if event.kind == EventKind.COMPLETED:
        return "route completed"
    if event.kind == EventKind.OUTSIDE_LANES:
        return f"{EVENT_NAMES[event.kind]} for {event.value:.1f} m"
    if event.kind == EventKind.MIN_SPEED:
        return f"{EVENT_NAMES[event.kind]}: {event.value:.0f} % of the traffic's pace"
    return EVENT_NAMES[event.kind]


def met(event: EventRecord) -> str:
    """Whom or what an event was with, with its number."""
    if event.other_type:
        return f"{event.other_type} {event.other}"
    at_light = event.kind in (EventKind.RED_LIGHT, EventKind.RED_LIGHT_WIDE)
    return f"light {event.other}" if at_light else ""


def shown_events(record: RouteRecord, run: RunRecord) -> Iterator[EventRecord]:
    """The events of a route that the run's rules count as infractions."""
    kinds = rules_named(run.rules).infractions
    return (event for event in record.events if event.kind in kinds)


def moment_link(record: RouteRecord, time_s: float, text: Content) -> Markup:
    """A link to a moment of a route's replay; `#route=3&seed=0&t=12.5` may also be sent around."""
    place = f"#route={record.route_id}&seed={record.seed}&t={time_s:.2f}"
    return element("a", text, href=place)


def route_table(run: RunRecord, records: Sequence[RouteRecord], shown: set[int]) -> Markup:
    """A row for each route and seed.

    Args:
        run: The run.
        records: Its routes that the page is about, see `worst_first`.
        shown: Those that can be replayed, by `index`.
    """
    rows = [_route_row(run, record, replayed=record.index in shown) for record in records]
    driven = [record for record in records if not record.lost]
    last = _mean_row(run, driven) if driven else ()
    table = TableOf(id="routes", headings=ROUTE_HEADINGS, rows=rows, last=last, ascending="DS")
    return table.markup()


def _route_row(run: RunRecord, record: RouteRecord, *, replayed: bool) -> list[Cell]:
    name: Content = record.route_id
    if replayed:
        name = moment_link(record, 0.0, name)
    first = [
        Cell(shows=name, sort=record.route_id, note=_interventions(record)),
        Cell(shows=str(record.seed)),
    ]
    if record.lost:
        dashes = [Cell(shows="-", sort=-1.0) for _ in range(7)]
        why = Cell(shows=element("span", f"lost: {plain_status(record.status)}", class_="lost"))
        return [*first, *dashes, why, Cell(shows=record.reason), Cell(shows="")]
    score = record.score
    bound = "-" if record.bound is None else f"{record.bound.route_completion:.1f}"
    return [
        *first,
        Cell(shows=f"{score.driving_score:.1f}", sort=score.driving_score),
        Cell(shows=f"{score.route_completion:.1f}", sort=score.route_completion),
        Cell(shows=f"{score.infraction_score:.2f}", sort=score.infraction_score),
        Cell(shows=bound),
        Cell(shows=f"{scored_per_km([record], run):.2f}"),
        Cell(shows=f"{record.done_m / 1000:.2f}", note=f"of {record.length_m / 1000:.2f} km"),
        Cell(shows=f"{record.game_s:.1f}", sort=record.game_s),
        Cell(shows=plain_status(record.status), note=record.reason or None),
        Cell(shows=summary([record], rules_named(run.rules))),
        Cell(shows=scenarios_text(record)),
    ]


def _interventions(record: RouteRecord) -> str | None:
    return f"with {'; '.join(record.interventions)}" if record.interventions else None


def scenarios_text(record: RouteRecord) -> str:
    """How many scenarios began of each type: `S1 x2, S3`."""
    counts = sorted(record.scenarios.items(), key=lambda pair: int(pair[0]))
    return ", ".join(f"S{kind}" + (f" x{n}" if n > 1 else "") for kind, n in counts)


def _mean_row(run: RunRecord, records: Sequence[RouteRecord]) -> list[Cell]:
    seeds = sorted({record.seed for record in records})
    driving, completion, penalty = (
        mean_interval(seed_means(records, value, seeds))
        for value in ("driving_score", "route_completion", "infraction_score")
    )
    bound = mean_bound(records)
    doubt = "" if penalty.half_width is None else f" ± {penalty.half_width:.2f}"
    return [
        Cell(shows="mean"),
        Cell(shows=f"{len(seeds)} seed{'s' if len(seeds) > 1 else ''}"),
        Cell(shows=str(driving)),
        Cell(shows=str(completion)),
        Cell(shows=f"{penalty.mean:.2f}{doubt}"),
        Cell(shows="-" if bound is None else f"{bound:.1f}"),
        Cell(shows=f"{scored_per_km(records, run):.2f}"),
        Cell(shows=f"{_driven_km(records) / len(records):.2f}"),
        Cell(shows=f"{math.fsum(record.game_s for record in records) / len(records):.1f}"),
        *(Cell(shows="") for _ in range(3)),
    ]


def _driven_km(records: Sequence[RouteRecord]) -> float:
    return math.fsum(record.done_m for record in records) / 1000.0


def event_table(run: RunRecord, records: Sequence[RouteRecord], shown: set[int]) -> Markup:
    """A row for each infraction, with a link to its moment."""
    rows = []
    for record in records:
        for event in shown_events(record, run):
            time: Content = f"{event.time_s:.2f}"
            if record.index in shown:
                time = moment_link(record, event.time_s, time)
            mark = element("span", "", class_=f"dot kind-{EVENT_KEYS[event.kind]}")
            rows.append(
                [
                    Cell(shows=record.route_id),
                    Cell(shows=str(record.seed)),
                    Cell(shows=time, sort=event.time_s),
                    Cell(shows=joined([mark, event_text(event)]), sort=event_text(event)),
                    Cell(shows=met(event)),
                    Cell(shows=f"{event.x:.1f}, {event.y:.1f}", sort=event.x),
                ]
            )
    if not rows:
        return element("p", "No infraction.", class_="none")
    return TableOf(id="events", headings=EVENT_HEADINGS, rows=rows).markup()


def summary_cards(run: RunRecord, records: Sequence[RouteRecord]) -> Markup:
    """The means in large figures."""
    driven = [record for record in records if not record.lost]
    if not driven:
        return element("p", "No route was driven: there is no score.", class_="none")
    mean = _mean_row(run, driven)
    names = (
        *("driving score, %", "route completion, %", "infraction score, 0 to 1"),
        *("bound on the score, %", "infractions a km"),
    )
    cards = [_card(name, cell.shows) for name, cell in zip(names, mean[2:7], strict=True)]
    cards[0] = _card(names[0], mean[2].shows, main=True)
    return joined([*cards, _card("km driven", f"{_driven_km(driven):.1f}")])


def _card(name: str, value: Content, *, main: bool = False) -> Markup:
    parts = (element("dt", name), element("dd", value))
    return element("div", *parts, class_="card main" if main else "card")


def facts_table(run: RunRecord) -> Markup:
    """What the results rest on."""
    options = ", ".join(f"{name}={value}" for name, value in sorted(run.options.items()))
    pairs = {
        "agent": f"{run.agent} ({run.agent_version})",
        "track": run.track,
        "suite": f"{run.suite}" + (f", version {run.suite_version}" if run.suite_version else ""),
        "town": f"{run.town} ({run.town_hash})",
        "routes": run.routes_hash,
        "options": options or "the suite's",
        "asked for": asked_for(run.requires),
        "rules": run.rules,
        "seeds": ", ".join(map(str, run.seeds)),
        "versions": ", ".join(f"{name} {version}" for name, version in run.versions.items()),
        "CPU": run.cpu,
    }
    rows = (element("div", element("dt", name), element("dd", v)) for name, v in pairs.items())
    return element("dl", *rows, class_="facts")
