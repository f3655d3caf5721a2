"""Prints finished runs as one Markdown table, such as the README's.

driveinsight evaluate --agent expert --suite town05_short --seeds 3
python benchmarks/score_table.py results/*
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from di_envs.rules import DI_1_0, rules_named
from leaderboard.records.record import RunRecord
from leaderboard.records.results import ResultsError, read_run
from leaderboard.statistics.confidence import mean_interval
from leaderboard.tables.run_tables import by_our_rules, driving_interval, mean_bound, seed_means

HEADER = (
    "| agent | track | suite | DS | DS `di-1.0` | RC | IS | bound | infractions a km |",
    "|---|---|---|---:|---:|---:|---:|---:|---:|",
)


def row(run: RunRecord) -> str:
    """One run: means over routes and seeds, with the 95 % t-interval of the means by seed."""
    driven_km = math.fsum(record.done_m for record in run.routes) / 1000.0
    scored = rules_named(run.rules).scored
    count = sum(event.kind in scored for record in run.routes for event in record.events)
    completion = mean_interval(seed_means(run.routes, "route_completion", run.seeds))
    penalty = mean_interval(seed_means(run.routes, "infraction_score", run.seeds))
    bound = mean_bound(run.routes)
    ours = run if run.rules == DI_1_0.name else by_our_rules(run)
    cells = [
        f"`{run.agent}`",
        run.track,
        f"`{run.suite}`" + ("" if run.complete else " (not complete)"),
        str(driving_interval(run)),
        "-" if ours is None else str(driving_interval(ours)),
        str(completion),
        f"{penalty.mean:.2f}",
        "-" if bound is None else f"{bound:.1f}",
        f"{count / driven_km:.2f}" if driven_km > 0.0 else "-",
    ]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Reads the runs, sorts them by suite and score, prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="+", type=Path, help="folders of finished runs")
    try:
        runs = [read_run(folder) for folder in parser.parse_args().folders]
    except ResultsError as error:
        parser.error(str(error))
    runs.sort(key=lambda run: (run.suite, -driving_interval(run).mean))
    print(*HEADER, *map(row, runs), sep="\n")


if __name__ == "__main__":
    main()
