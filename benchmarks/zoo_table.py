"""The zoo in one table, beside what the paper's Table 1 says, and how alike the two orders are.

    python -m benchmarks.zoo_table

It is of every network that has a record on the leaderboard (`docs/records`, to which
`docs/scripts/leaderboard_page.py --add RUN` adds). `--brief` prints what the README has. SR is the
share of drives that were completed without an infraction. Samples seen are those with pictures and,
after a + those of a planner alone, of all stages of its recipe whose weights it begins with, and a
teacher's. Parameters and milliseconds are of `benchmarks/zoo.py`, which measures them anew here.
Spearman's correlation is of the mean DS with the paper's, over the systems that both have; its
intervals say how far it could have come out otherwise with other routes (95 %, bootstrap over
routes, all systems on the same ones) and with other systems (95 %, Fieller, Hartley, Pearson: Tests
for Rank Correlation Coefficients, Biometrika 1957).
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from torch import nn

from agents import AGENTS, load_agent
from agents.base import Agent
from agents.driveinsight.agent import DriveInsightAgent
from agents.driveinsight.model import Policy
from agents.sb3.agent import Sb3Agent
from agents.zoo.registry import system_names
from benchmarks.samples_seen import samples_seen
from benchmarks.zoo import decision_ms, parameters_of, system_cost
from docs.scripts.leaderboard_page import Record, column, infractions_a_km, interval, read_records
from leaderboard.statistics.bootstrap import TAIL, expanded_interval, resampled_means
from leaderboard.statistics.rank_correlation import spearman

SUITES = ("town05_short", "town05_long")
DRAWS = 2000  # of the routes, for the correlation's interval
NORMAL_95 = 1.96
COLUMNS = ("DS", "RC", "IS", "SR", "a km")  # on either suite
HEADER = (
    "system",
    *(f"{suite} {name}" for suite in ("Short", "Long") for name in COLUMNS),
    *("samples seen", "parameters", "ms", "paper Short", "paper Long", "Town05 in its training"),
)


BRIEF = (  # columns of the README's table
    *("system", "Short DS", "Short RC", "Long DS", "Long RC", "parameters", "ms"),
    *("paper Short", "paper Long"),
)


@dataclass(frozen=True)
class Published:
    """A row of the paper's Table 1: DS and RC, and what is known of its training."""

    short: tuple[float, float] | None
    long: tuple[float, float]
    town05: str

    def ds(self, suite: str) -> float | None:
        """Its DS on a suite of ours; None if it has none."""
        found = self.short if suite == SUITES[0] else self.long
        return None if found is None else found[0]


TABLE_1 = {
    "lbc": Published((31.0, 55.0), (12.3, 31.9), "not said"),
    "transfuser": Published((54.5, 78.4), (31.0, 47.5), "no"),
    "st-p3": Published((55.1, 86.7), (11.5, 83.2), "not said"),
    "vad": Published((64.3, 87.3), (30.3, 75.2), "not said"),
    "mile": Published(None, (61.1, 97.4), "no"),
    "thinktwice": Published(None, (70.9, 95.5), "yes (65.0 without)"),
    "interfuser": Published((94.9, 95.2), (68.3, 95.0), "no"),
    "driveadapter": Published(None, (71.9, 97.3), "yes (61.7 without)"),
    "driveinsight": Published((93.2, 95.8), (64.4, 100.0), "no"),
    "driveinsight-town05": Published((95.3, 99.2), (66.6, 100.0), "yes"),
}
TWICE = "driveinsight"  # in the paper's order too, but with Town05 in training: compared once


def success_rate(record: Record) -> float:
    """The share of drives that were completed with no infraction that lowers the score, in %."""
    drives = zip(
        column(record, "route_completion"), column(record, "infraction_score"), strict=True
    )
    whole = [completion >= 100.0 and kept >= 1.0 for completion, kept in drives]
    return 100.0 * sum(whole) / len(whole)


def _cells(record: Record | None) -> list[str]:
    if record is None:
        return ["-"] * len(COLUMNS)
    return [
        str(interval(record, "driving_score")),
        f"{interval(record, 'route_completion').mean:.1f}",
        f"{interval(record, 'infraction_score').mean:.2f}",
        f"{success_rate(record):.0f}",
        infractions_a_km(record),
    ]


def cost_of(name: str) -> list[str]:
    """Parameters, and milliseconds a decision, of a shipped policy or system.

    A record may name a file as its agent, which is nobody's leave to run it.
    """
    if name in system_names():
        size, spent_ms = system_cost(name)
    elif name in AGENTS and (network := _network_of(agent := load_agent(name))) is not None:
        size, spent_ms = parameters_of(network), decision_ms(agent)
    else:
        return ["-", "-"]
    return [f"{size:,}", f"{spent_ms:.0f}"]


def _network_of(agent: Agent[Any]) -> nn.Module | None:
    """What it has learnt, whole: a policy that drives has its norms folded into convolutions."""
    if isinstance(agent, DriveInsightAgent):
        return Policy(agent.policy.config)
    return agent.network if isinstance(agent, Sb3Agent) else None


def _row(name: str, records: Mapping[str, Record]) -> dict[str, str]:
    """The cells of a row, by the names of their columns."""
    paper = TABLE_1.get(name)
    theirs = ["-", "-", "-"]
    if paper is not None:
        pairs = (paper.short, paper.long)
        theirs = ["-" if pair is None else f"{pair[0]} / {pair[1]}" for pair in pairs]
        theirs.append(paper.town05)
    cells = [cell for suite in SUITES for cell in _cells(records.get(suite))]
    seen = samples_seen(name) or "-"
    whole = [f"`{name}`", *cells, str(seen), *cost_of(name), *theirs]
    return dict(zip(HEADER, whole, strict=True))


def line_of(cells: Mapping[str, str], columns: Sequence[str]) -> str:
    """A row of the table, of these columns."""
    return f"| {' | '.join(cells[column] for column in columns)} |"


def rank_line(suite: str, found: Mapping[str, Mapping[str, Record]]) -> str:
    """How alike our order and the paper's are on a suite."""
    pairs = {
        name: (records[suite], paper.ds(suite))
        for name, records in found.items()
        if suite in records and name != TWICE and (paper := TABLE_1.get(name)) is not None
    }
    known = {name: (record, ds) for name, (record, ds) in pairs.items() if ds is not None}
    theirs = [ds for _, ds in known.values()]
    ours = [interval(record, "driving_score").mean for record, _ in known.values()]
    rho = spearman(ours, theirs)
    if rho is None:
        return f"`{suite}`: {len(known)} systems are in both: too few for a correlation."
    return (
        f"`{suite}`: Spearman's {rho:+.2f} over {len(known)} systems ({', '.join(known)}); "
        f"with other routes {_over_routes([record for record, _ in known.values()], theirs)}, "
        f"with other systems {_over_systems(rho, len(known))}."
    )


def _over_routes(records: Sequence[Record], theirs: Sequence[float]) -> str:
    """The interval over routes, of which all records have the same."""
    means = [
        resampled_means(column(record, "driving_score"), column(record, "route"), DRAWS)
        for record in records
    ]
    routes = {tuple(sorted(set(column(record, "route")))) for record in records}
    if len(routes) != 1 or any(each is None for each in means):
        return "not known: the records are not of the same routes"
    drawn = np.stack(means, axis=1)  # type: ignore[arg-type]
    found = [spearman(list(row), theirs) for row in drawn]
    known = np.array([each for each in found if each is not None])
    low, high = expanded_interval(known, len(next(iter(routes))), TAIL)
    return f"{low:+.2f} … {high:+.2f}"


def _over_systems(rho: float, count: int) -> str:
    if count < 5 or abs(rho) == 1.0:
        return "not known: too few"
    spread = NORMAL_95 * math.sqrt(1.06 / (count - 3))
    low, high = (math.tanh(math.atanh(rho) + side * spread) for side in (-1.0, 1.0))
    return f"{low:+.2f} … {high:+.2f}"


def main() -> None:
    """Prints the table, the highest DS on Long first, and a line on each suite's order."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--brief", action="store_true", help="the README's columns alone")
    columns = BRIEF if parser.parse_args().brief else HEADER
    found: dict[str, dict[str, Record]] = {}
    for record in read_records().values():
        if record["suite"] in SUITES:
            found.setdefault(record["agent"], {})[record["suite"]] = record

    def rank(name: str) -> tuple[float, ...]:
        driven = [found[name].get(suite) for suite in SUITES[::-1]]
        return tuple(0.0 if r is None else -interval(r, "driving_score").mean for r in driven)

    print(line_of(dict(zip(HEADER, HEADER, strict=True)), columns))
    print(f"|---|{'---:|' * (len(columns) - 1)}")
    for name in sorted(found, key=rank):
        row = _row(name, found[name])
        if row["parameters"] != "-":  # a network
            print(line_of(row, columns), flush=True)
    print(*("\n" + rank_line(suite, found) for suite in SUITES), sep="")


if __name__ == "__main__":
    main()
