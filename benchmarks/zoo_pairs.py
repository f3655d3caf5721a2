"""What sight and rules are worth to each system of the zoo, and what it has over those blind.

    driveinsight evaluate --agent transfuser --suite town05_short --seeds 3 --output t
    driveinsight evaluate ... --intervene "blackout:cameras; clear:lidar" --seeds 1 --output t-blind
    driveinsight evaluate --agent "transfuser?rules=off" ... --seeds 1 --output t-off
    driveinsight evaluate --agent ego-only ... --output ego
    python -m benchmarks.zoo_pairs t t-blind t-off ego ...

Each run of a system as it is shipped is set beside its own with interventions or options, and
beside `route-only` and `ego-only` where they are given. Differences are the system's DS less the
other's, paired by route and seed, with 95 % intervals by bootstrap over routes: above 0 is better.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import fmean

from benchmarks.two_by_two import shown
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.records.results import ResultsError, read_run
from leaderboard.studies.comparing import PairingError, compare_runs

HEADER = (
    "| system | beside | pairs | DS | DS there | difference |",
    "|---|---|---:|---:|---:|---:|",
)
FLOORS = ("route-only", "ego-only")


def system_of(run: RunRecord) -> str:
    """The agent's name without options."""
    return run.agent.partition("?")[0]


def as_shipped(run: RunRecord) -> bool:
    """Whether it was driven without options and interventions."""
    return "?" not in run.agent and not run.interventions


def beside(runs: Sequence[RunRecord]) -> Iterator[tuple[RunRecord, RunRecord]]:
    """Each run as shipped with those that it is set beside: its own first, then the floors.

    Raises:
        ValueError: If a run has none as shipped, or two.
    """
    shipped = dict[str, RunRecord]()
    for run in filter(as_shipped, runs):
        if run.agent in shipped:
            raise ValueError(f"two runs of {run.agent} as it is shipped: give one")
        shipped[run.agent] = run
    for run in runs:
        if system_of(run) not in shipped:
            raise ValueError(f"a run of {run.agent} without one of {system_of(run)} as shipped")
    floors = [shipped[name] for name in FLOORS if name in shipped]
    for name, run in shipped.items():
        yield from ((run, other) for other in runs if system_of(other) == name and other is not run)
        yield from ((run, floor) for floor in floors if name not in FLOORS)


def row(run: RunRecord, other: RunRecord) -> str:
    """A system beside another, over the routes and seeds that both drove.

    Raises:
        PairingError: If there are none, or their worlds are not the same.
    """
    comparison = compare_runs(other, run)
    cells = (
        _name(run),
        _name(other),
        str(len(comparison.pairs)),
        _mean([pair.after for pair in comparison.pairs]),
        _mean([pair.before for pair in comparison.pairs]),
        shown(comparison.interval("driving_score")),
    )
    return f"| {' | '.join(cells)} |"


def _name(run: RunRecord) -> str:
    return f"`{'; '.join([run.agent, *run.interventions])}`"


def _mean(records: Sequence[RouteRecord]) -> str:
    return f"{fmean(record.score.driving_score for record in records):.1f}"


def main() -> None:
    """Prints a row for each pair of runs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="+", type=Path, help="folders of runs")
    try:
        pairs = list(beside([read_run(folder) for folder in parser.parse_args().folders]))
        rows = [row(run, other) for run, other in pairs]
    except (ResultsError, PairingError, ValueError) as error:
        parser.error(str(error))
    if not rows:
        parser.error("nothing to set beside: give runs with interventions or options too")
    print(*HEADER, *rows, sep="\n")


if __name__ == "__main__":
    main()
