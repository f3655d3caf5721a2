"""Two components taken away alone and together: what each gives while the other is there, or not.

    driveinsight evaluate --agent driveinsight --suite town05_long --seeds 3 --output all
    driveinsight evaluate ... --intervene drop:obstacles --output no-obstacles
    driveinsight evaluate ... --intervene drop:bev --output no-bev
    driveinsight evaluate ... --intervene "drop:obstacles; drop:bev" --output neither
    python benchmarks/two_by_two.py all no-obstacles no-bev neither

Differences are paired by route and seed, with 95 % intervals by bootstrap over routes. The
interaction is what taking the second away costs more once the first is gone: near nothing if each
does its own work, negative if one stands in for the other. More runs may follow (such as one whose
BEV is another moment's): each is set against the first.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from leaderboard.records.record import RunRecord
from leaderboard.records.results import ResultsError, read_run
from leaderboard.statistics.bootstrap import BootstrapInterval, clustered_interval
from leaderboard.statistics.confidence import mean_interval
from leaderboard.studies.comparing import Comparison, PairingError, compare_runs
from leaderboard.tables.run_tables import driving_interval, seed_means


def interaction(first: Comparison, second: Comparison, both: Comparison) -> BootstrapInterval:
    """What both cost together, less what each costs alone, over the pairs that all have.

    Args:
        first: The whole against the run without the first component.
        second: The whole against the run without the second.
        both: The whole against the run without either.
    """
    costs = [
        {(pair.before.route_id, pair.before.seed): pair for pair in comparison.pairs}
        for comparison in (first, second, both)
    ]
    shared = [key for key in costs[2] if key in costs[0] and key in costs[1]]
    values = [
        costs[2][key].difference - costs[0][key].difference - costs[1][key].difference
        for key in shared
    ]
    return clustered_interval(values, [costs[2][key].before.route_hash for key in shared])


def shown(interval: BootstrapInterval) -> str:
    """The value with its interval, if it has one."""
    if interval.low is None or interval.high is None:
        return f"{interval.value:+.1f}"
    return f"{interval.value:+.1f} ({interval.low:+.1f} … {interval.high:+.1f})"


def _row(run: RunRecord, change: str) -> str:
    completion = mean_interval(seed_means(run.routes, "route_completion", run.seeds))
    edits = "; ".join(run.interventions) or "all given"
    return f"| {edits} | {driving_interval(run)} | {completion} | {change} |"


def main() -> None:
    """Prints the arms, each against the first, and the interaction."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="+", type=Path, help="of four runs, or more")
    folders = parser.parse_args().folders
    if len(folders) < 4:
        parser.error(f"expected the folders of four runs, got {len(folders)}; see --help")
    try:
        whole, *others = map(read_run, folders)
        found = [compare_runs(whole, other) for other in others]
    except (ResultsError, PairingError) as error:
        parser.error(str(error))
    print("| intervention | DS | RC | DS, paired with the first |")
    print("|---|---:|---:|---:|")
    print(_row(whole, ""))
    for other, comparison in zip(others, found, strict=True):
        print(_row(other, shown(comparison.interval("driving_score"))))
    print(f"\nInteraction: {shown(interaction(*found[:3]))} DS over {len(found[2].pairs)} pairs.")


if __name__ == "__main__":
    main()
