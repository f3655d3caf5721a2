"""Trains a tiny policy end to end, from nothing to its score beside `constant`'s: one command.

    python examples/train_tiny.py

It runs `driveinsight train --recipe recipes/tiny.toml` and `evaluate` as anyone would, and shows
each command. The policy is taught twice: by the expert's drives, and by what the expert would have
done in its own. Stopped with Ctrl-C, the same command goes on. Under ten minutes on two free cores.
It needs torch: `pip install -c constraints.txt -e ".[policy]"`.
"""

from __future__ import annotations

import io
import shlex
import sys
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console
from rich.table import Table

from agents.training.recipes.recipe import read_recipe
from di_envs.rules import rules_named
from leaderboard.commands.cli import main as driveinsight
from leaderboard.records.record import RunRecord
from leaderboard.records.results import read_run
from leaderboard.scoring.score import mean_score
from leaderboard.tables.run_tables import summary

SUITE = "town05_tiny"  # 105 short routes over single crossings, in a town that training never sees
RECIPE = Path(__file__).resolve().parents[1] / "recipes" / "tiny.toml"
CONSOLE = Console(file=sys.stdout)  # also while a command's own output is put aside


@dataclass(frozen=True, kw_only=True)
class Lesson:
    """What is taught, and where it is put to the test."""

    folder: Path = Path("tiny")
    """Where everything goes."""

    recipe: Path = RECIPE
    """How the policy is taught."""

    route_ids: tuple[str, ...] = ()
    """Routes of the suite that are driven in the end; all if none is named."""

    workers: int = 2
    """Processes that drive."""


def run(command: str, *arguments: object) -> None:
    """Runs a command of `driveinsight`, and leaves with its exit code if it does not succeed."""
    words = [command, *map(str, arguments)]
    CONSOLE.print(f"\n[bold]$ driveinsight {shlex.join(words)}", highlight=False, soft_wrap=True)
    code = driveinsight(words)
    if code:
        sys.exit(code)


def score(agent: str, folder: Path, lesson: Lesson) -> RunRecord:
    """Has an agent drive the suite; everything that it did is in the folder."""
    where = ("--output", folder, "--resume", "--workers", lesson.workers)
    where += ("--route-ids", *lesson.route_ids) if lesson.route_ids else ()
    with redirect_stdout(io.StringIO()):  # a row for each route: `driveinsight show` has them
        run("evaluate", "--agent", agent, "--suite", SUITE, *where)
    return read_run(folder)


def side_by_side(runs: dict[str, RunRecord]) -> Table:
    """Each agent's means over the suite, and how often it did wrong."""
    table = Table(title=f"{SUITE}, seed 0")
    table.add_column("agent", no_wrap=True)
    for column in ("DS", "RC", "IS"):  # driving score, route completion, infraction score
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("infractions")
    for name, each in runs.items():
        driving, completion, penalty = mean_score([record.score for record in each.scored])
        done_wrong = summary(each.scored, rules_named(each.rules))
        table.add_row(name, f"{driving:.1f}", f"{completion:.1f}", f"{penalty:.2f}", done_wrong)
    return table


def main(lesson: Lesson) -> None:
    """Trains, drives, and prints the table."""
    made = lesson.folder / "made"
    run("train", "--recipe", lesson.recipe, "--output", made, "--workers", lesson.workers)
    policy = made / read_recipe(lesson.recipe).stages[-1].name / "policy"
    runs = {
        "constant": score("constant", lesson.folder / "constant", lesson),
        "tiny": score(f"driveinsight:{policy}", lesson.folder / "driven", lesson),
    }
    CONSOLE.print(side_by_side(runs))
    CONSOLE.print(f"Next: driveinsight report {lesson.folder / 'driven'}", highlight=False)


if __name__ == "__main__":
    main(tyro.cli(Lesson, description=__doc__))
