"""The leaderboard as a terminal table: scores by route with the bound beside them, and means."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence

from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from di_envs.files.shown_text import in_one_line
from di_envs.rules import DI_1_0, Rules, rules_named
from leaderboard.records.claim_text import claim_lines
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.records.rescoring import records_all, rescored
from leaderboard.scoring.names import EVENT_NAMES, SCENARIO_NAMES
from leaderboard.scoring.score import count_infractions, infractions_per_km
from leaderboard.statistics.confidence import MeanInterval, mean_interval


def seed_means(records: Sequence[RouteRecord], value: str, seeds: Iterable[int]) -> list[float]:
    """One mean over routes for each seed that has any, of `value`, a property of `Score`."""
    by_seed = ([getattr(r.score, value) for r in records if r.seed == seed] for seed in seeds)
    return [math.fsum(values) / len(values) for values in by_seed if values]


def run_tables(run: RunRecord) -> Group:
    """The leaderboard table of a run, its infractions by kind, and what they rest on."""
    if not run.scored:
        lost = [Text(line) for line in (*_refused_lines(run), *_lost_lines(run), *run.notes)]
        return Group(Text("no route was finished: there is nothing to show"), *lost)
    tables = [_route_table(run), _infraction_table(run)]
    if any(record.scenarios for record in run.scored):
        tables.append(_scenario_table(run))
    return Group(*tables, Text(_caption(run), style="dim"))


def print_run(run: RunRecord, console: Console) -> None:
    """Prints the tables of a run."""
    console.print(run_tables(run))


def _route_table(run: RunRecord) -> Table:
    ours = by_our_rules(run)
    title = f"{run.title} on {run.suite} · track {run.track} · rules {run.rules}"
    table = Table(title=in_one_line(title), title_justify="left", title_style="bold")
    table.add_column("route")
    for name in ("DS", *([f"DS\n{DI_1_0.name}"] if ours else []), "RC", "IS", "bound", "infr./km"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("what happened", overflow="fold")
    for route_id in dict.fromkeys(record.route_id for record in run.routes):
        records = [record for record in run.routes if record.route_id == route_id]
        driving, *cells = _cells(records, run)
        own = [_driving_cell(ours, route_id)] if ours else []
        table.add_row(route_id, driving, *own, *cells)
    for route_id, why in run.refused.items():
        reason = _briefly(why.removeprefix(f"Route '{route_id}': "))
        blank = ["-"] * (6 if ours else 5)
        table.add_row(route_id, *blank, f"could not be planned: {reason}")
    table.add_section()
    driving, *cells = _mean_cells(run)
    own = [_stacked(driving_interval(ours))] if ours else []
    table.add_row("mean", driving, *own, *cells, style="bold")
    return table


def _briefly(reason: str) -> str:
    """What is wrong, without what to do about it, which stands below the table."""
    return reason.partition("; ")[0].partition(". ")[0]


def by_our_rules(run: RunRecord) -> RunRecord | None:
    """The run as `di-1.0` scores it; None where it is so already, or was recorded too early."""
    if run.rules == DI_1_0.name or not records_all(run, DI_1_0):
        return None
    return rescored(run, DI_1_0)


def _driving_cell(run: RunRecord, route_id: str) -> str:
    """DS of one route, over its seeds."""
    scores = [record.score for record in run.scored if record.route_id == route_id]
    return f"{_mean([score.driving_score for score in scores]):.1f}" if scores else "-"


def _cells(records: Sequence[RouteRecord], run: RunRecord) -> list[str]:
    """DS, RC, IS, bound, infractions per km and a summary, over the seeds of one route."""
    driven = [record for record in records if not record.lost]
    if not driven:
        return ["-"] * 5 + [summary(records, rules_named(run.rules))]
    scores = [record.score for record in driven]
    return [
        f"{_mean([score.driving_score for score in scores]):.1f}",
        f"{_mean([score.route_completion for score in scores]):.1f}",
        f"{_mean([score.infraction_score for score in scores]):.2f}",
        _bound_cell(driven),
        f"{scored_per_km(driven, run):.2f}",
        summary(records, rules_named(run.rules)),
    ]


def _mean_cells(run: RunRecord) -> list[str]:
    completion = mean_interval(seed_means(run.scored, "route_completion", run.seeds))
    penalty = mean_interval(seed_means(run.scored, "infraction_score", run.seeds))
    penalty_text = f"{penalty.mean:.2f}"
    if penalty.half_width is not None:
        penalty_text += f"\n± {penalty.half_width:.2f}"
    return [
        _stacked(driving_interval(run)),
        _stacked(completion),
        penalty_text,
        _bound_cell(run.scored),
        f"{scored_per_km(run.scored, run):.2f}",
        "",
    ]


def _stacked(interval: MeanInterval) -> str:
    """A mean with its doubt below it: eight columns have to fit into a narrow terminal."""
    return str(interval).replace(" ± ", "\n± ")


def driving_interval(run: RunRecord) -> MeanInterval:
    """The run's mean DS, with the t-interval of its means by seed."""
    return mean_interval(seed_means(run.scored, "driving_score", run.seeds))


def mean_bound(records: Iterable[RouteRecord]) -> float | None:
    """The mean light-limited DS of those routes for which it is known."""
    bounds = [record.bound.route_completion for record in records if record.bound is not None]
    return _mean(bounds) if bounds else None


def _bound_cell(records: Iterable[RouteRecord]) -> str:
    bound = mean_bound(records)
    return "-" if bound is None else f"{bound:.1f}"


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values)


def scored_per_km(records: Sequence[RouteRecord], run: RunRecord) -> float:
    """Infractions that lower IS, per kilometre driven, over all these records together."""
    rules = rules_named(run.rules)
    count = sum(event.kind in rules.scored for record in records for event in record.events)
    return infractions_per_km(count, math.fsum(record.done_m for record in records))


def summary(records: Sequence[RouteRecord], rules: Rules) -> str:
    """What went wrong, counted: `2 red light, 1 timeout, 1 agent crashed`."""
    driven = [record for record in records if not record.lost]
    kinds = count_infractions((event.kind for r in driven for event in r.events), rules)
    parts = [f"{count} {EVENT_NAMES[kind]}" for kind, count in kinds.items() if count]
    crashes = Counter(record.status for record in driven if record.crashed)
    parts += [f"{count} {plain_status(status)}" for status, count in crashes.items()]
    lost = Counter(record.status for record in records if record.lost)
    parts += [f"{count} lost ({plain_status(status)})" for status, count in lost.items()]
    return ", ".join(parts)


def plain_status(status: str) -> str:
    """A status without the word that they share: `Worker died`."""
    return status.removeprefix("Failed - ")


def _infraction_table(run: RunRecord) -> Table:
    table = Table(title="infractions", title_justify="left", title_style="bold")
    table.add_column("kind")
    table.add_column("count", justify="right")
    table.add_column("per km", justify="right")
    driven_m = math.fsum(record.done_m for record in run.scored)
    happened = (event.kind for record in run.scored for event in record.events)
    kinds = count_infractions(happened, rules_named(run.rules))
    for kind, count in kinds.items():
        table.add_row(EVENT_NAMES[kind], str(count), f"{infractions_per_km(count, driven_m):.3f}")
    return table


def _scenario_table(run: RunRecord) -> Table:
    """How many scenarios of each type began."""
    table = Table(title="scenarios that began", title_justify="left", title_style="bold")
    table.add_column("type")
    table.add_column("what happens")
    table.add_column("count", justify="right")
    counts = Counter[str]()
    for record in run.scored:
        counts.update(record.scenarios)
    for number in sorted(counts, key=int):
        name = SCENARIO_NAMES.get(number, "")
        table.add_row(f"S{number}", name, str(counts[number]))
    return table


def _caption(run: RunRecord) -> str:
    routes = len({record.route_id for record in run.scored})
    routes_of = f"{routes} route{'s' if routes > 1 else ''} of {run.town}"
    driven_km = math.fsum(record.done_m for record in run.scored) / 1000.0
    seeds = len({record.seed for record in run.scored})
    if seeds == 1:
        doubt = f"one seed ({run.scored[0].seed}): no confidence interval"
    else:
        doubt = f"± is the 95 % t-interval of the means of {seeds} seeds"
    lines = [
        f"{routes_of}, {driven_km:.1f} km driven; {doubt}.",
        "bound: DS of a perfect driver on empty roads with the same lights, under the timeout.",
        *claim_lines(run),
    ]
    if not records_all(run, DI_1_0):
        lines.append(f"DS under {DI_1_0.name} is not known: this run's world did not record it.")
    if not run.complete:
        lines.append(f"Not complete: {len(run.routes)} of {run.planned} routes x seeds.")
    lines += [*_refused_lines(run), *_lost_lines(run), *run.notes]
    return "\n".join(map(in_one_line, lines))


def _refused_lines(run: RunRecord) -> list[str]:
    """That routes of the file were not driven by anybody."""
    if not run.refused:
        return []
    driven = len({record.route_id for record in run.routes})
    return [
        f"Left out of every mean: {len(run.refused)} of {driven + len(run.refused)} routes, which "
        "could not be planned (--strict refuses the file)."
    ]


def _lost_lines(run: RunRecord) -> list[str]:
    """That routes are left out, and how to drive them after all."""
    if not run.lost:
        return []
    return [
        f"Left out of every mean: {len(run.lost)} of {run.planned} routes x seeds, lost to the "
        "machinery and not to the driving.",
        "To drive them after all: the same command with --resume.",
    ]
