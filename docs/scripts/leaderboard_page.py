"""Keeps the leaderboard: records of runs that stood `verify`, and docs/leaderboard.md's tables.

python docs/scripts/leaderboard_page.py                          # draws the tables anew
python docs/scripts/leaderboard_page.py --add results/RUN        # verifies a run, then adds it
"""

from __future__ import annotations

import argparse
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from di_envs.files.json_text import by_lines, compact, read_json
from di_envs.files.whole import write_whole
from di_envs.rules import rules_named
from di_envs.world.event_names import EVENT_KEYS
from leaderboard.records.record import RunRecord
from leaderboard.records.results import ResultsError, read_run
from leaderboard.records.run_json import run_hash
from leaderboard.replaying.verify import verify_run
from leaderboard.statistics.confidence import MeanInterval, mean_interval

DOCS = Path(__file__).resolve().parents[1]
PAGE = DOCS / "leaderboard.md"
RECORDS = DOCS / "records"
BEGIN, END = "<!-- tables: python docs/scripts/leaderboard_page.py -->", "<!-- tables end -->"
HEADER = (
    "| agent | track | DS | RC | IS | bound | infractions a km | seeds | record |",
    "|---|---|---:|---:|---:|---:|---:|---:|---|",
)
# of a route with a seed, in the order of a record's rows
COLUMNS = ("route", "seed", "driving_score", "route_completion", "infraction_score", "bound", "km")

Record = Mapping[str, Any]


def record_of(run: RunRecord) -> dict[str, Any]:
    """What the leaderboard keeps of a run: how each route was driven, and what that rests on."""
    scored = rules_named(run.rules).scored
    counts = Counter(event.kind for r in run.routes for event in r.events if event.kind in scored)
    return {
        "format": "driveinsight-leaderboard-record",
        "format_version": 1,
        "agent": run.agent,
        "agent_version": run.agent_version,
        "track": str(run.track),
        "suite": run.suite,
        "suite_version": run.suite_version,
        "rules": run.rules,
        "options": dict(run.options),
        "seeds": list(run.seeds),
        "versions": dict(run.versions),
        "cpu": run.cpu,
        "run": run_hash(run),
        "infractions": {EVENT_KEYS[kind]: count for kind, count in sorted(counts.items())},
        "columns": list(COLUMNS),
        "routes": [
            [
                route.route_id,
                route.seed,
                round(route.score.driving_score, 4),
                round(route.score.route_completion, 4),
                round(route.score.infraction_score, 6),
                None if route.bound is None else round(route.bound.route_completion, 4),
                round(route.done_m / 1000.0, 5),
            ]
            for route in run.routes
        ],
    }


def add(folder: Path) -> Path:
    """Verifies a run and writes its record; returns the record's file.

    Raises:
        ValueError: If it is not complete, does not stand, or rests on something else than here.
    """
    run = read_run(folder)
    if not run.complete or run.lost:
        raise ValueError(f"{folder}: only runs of which every route was driven are listed")
    verdict = verify_run(run, folder)
    if not verdict.stands:
        raise ValueError(f"{folder} does not stand: driveinsight verify {folder} says why")
    if verdict.differences:
        raise ValueError(f"{folder} was driven elsewhere: here is {'; '.join(verdict.differences)}")
    name = re.sub(r"[^\w.-]+", "_", run.agent)
    path = RECORDS / run.suite / f"{name}.json"
    record = record_of(run)
    rows = ",\n".join(f"  {compact(row)}" for row in record.pop("routes"))
    head = {key: compact(value) for key, value in record.items()}
    text = by_lines({**head, "routes": f"[\n{rows}\n ]"})
    write_whole(path, text)
    return path


def read_records() -> dict[str, Record]:
    """All records by their place under docs/."""
    paths = sorted(RECORDS.glob("*/*.json"))
    return {path.relative_to(DOCS).as_posix(): read_json(path) for path in paths}


def tables(records: Mapping[str, Record]) -> str:
    """A table for each suite, version and rules: best driving score first."""
    groups: dict[str, list[tuple[str, Record]]] = {}
    for place, record in records.items():
        title = f"`{record['suite']}`, version {record['suite_version']}, rules `{record['rules']}`"
        groups.setdefault(title, []).append((place, record))
    parts = []
    for title, rows in sorted(groups.items()):
        rows.sort(key=lambda row: -interval(row[1], "driving_score").mean)
        parts.append("\n".join([f"## {title}", "", *HEADER, *(line(*row) for row in rows)]))
    return "\n\n".join(parts)


def line(place: str, record: Record) -> str:
    """A record as a row of its table."""
    bounds = [bound for bound in column(record, "bound") if bound is not None]
    version = re.sub(r"(files \w{8})\w+", r"\1…", record["agent_version"])  # whole in the record
    cells = (
        f"`{record['agent']}` ({version})",
        record["track"],
        str(interval(record, "driving_score")),
        str(interval(record, "route_completion")),
        f"{interval(record, 'infraction_score').mean:.2f}",
        f"{math.fsum(bounds) / len(bounds):.1f}" if bounds else "-",
        infractions_a_km(record),
        str(len(record["seeds"])),
        f"[{Path(place).name}]({place})",
    )
    return f"| {' | '.join(cells)} |"


def infractions_a_km(record: Record) -> str:
    """Infractions that lower IS, per kilometre driven."""
    km = math.fsum(column(record, "km"))
    return f"{sum(record['infractions'].values()) / km:.2f}" if km > 0.0 else "-"


def interval(record: Record, name: str) -> MeanInterval:
    """Mean over routes and seeds, with the 95 % t-interval of the means by seed."""
    seeds, values = column(record, "seed"), column(record, name)
    means = []
    for seed in record["seeds"]:
        own = [value for value, of in zip(values, seeds, strict=True) if of == seed]
        means.append(math.fsum(own) / len(own))
    return mean_interval(means)


def column(record: Record, name: str) -> list[Any]:
    """One value of every route with every seed."""
    place = record["columns"].index(name)
    return [row[place] for row in record["routes"]]


def with_tables(page: str, drawn: str) -> str:
    """The page's text with these tables between its two marks."""
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{drawn}\n\n{END}{after}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Adds a run if one is given, and draws the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--add", nargs="*", type=Path, default=[], help="folders of runs")
    for folder in parser.parse_args(arguments).add:
        try:
            print(f"added {add(folder)}")
        except (ResultsError, ValueError) as error:
            parser.error(str(error))
    write_whole(PAGE, with_tables(PAGE.read_text(encoding="utf-8"), tables(read_records())))


if __name__ == "__main__":
    main()
