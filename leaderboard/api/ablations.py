"""`ablate`: which components of what an agent knows matter, each taken away in turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from leaderboard.api.given_agents import GivenAgent, name_of, specification_of
from leaderboard.api.requests import requests
from leaderboard.api.runs import Routes, choose_scene
from leaderboard.api.shown import Shown
from leaderboard.studies.ablation import Ablation


@dataclass(frozen=True, kw_only=True, repr=False)
class Ablated(Shown):
    """What taking components away did.

    Attributes:
        ablation: The study, worked out.
        folder: Where its runs, table and figure are.
        complete: Whether all is driven; else the same call goes on.
    """

    ablation: Ablation
    folder: Path
    complete: bool

    @property
    def title(self) -> str:
        """Of whom, where, and how much of it there is."""
        study = self.ablation.study
        left = "" if self.complete else ", not complete"
        return f"Ablation of {study.agent} on {study.suite}{left}; {self.folder}"

    def rows(self) -> list[dict[str, Any]]:
        """A row for each component and way."""
        return [
            {
                "row": row.driven.row.name,
                "driving_score": row.driving_score,
                "difference": row.difference.mean,
                "low": row.difference.low,
                "high": row.difference.high,
                "verdict": row.verdict,
                "paper": row.paper_difference,
                "same_drives": row.same,
            }
            for row in self.ablation.rows
        ]


def ablate(
    agent: GivenAgent,
    suite: str | None = None,
    *,
    rows: Sequence[str] = (),
    only: str | None = None,
    seeds: int = 1,
    routes: Routes = (),
    rules: str = "carla-1.0",
    workers: int = 1,
    output: Path | str | None = None,
    isolate: bool = True,
    **options: Any,
) -> Ablated:
    """Takes away one component of what an agent knows after the other.

    What the folder holds of the study already is kept; Ctrl-C keeps what is driven.

    Args:
        agent: As for `evaluate`.
        suite: Where.
        rows: Such as `drop-routing`; `routing` is both ways of it; all when empty.
        only: `drop` or `zero`; None for both.
        seeds: How many.
        routes: Ids of those to drive; all when empty.
        rules: What the scores go by.
        workers: Processes to drive in.
        output: Folder of the study; None for `results/ablation-AGENT-SUITE`.
        isolate: Drive an agent that is not ours in a process of its own.
        options: Of the environment, as for `evaluate`.

    Raises:
        RequestError: If the agent, a row or an option is wrong.
    """
    from leaderboard.commands.evaluate import plain_name
    from leaderboard.pages.study_files import keep_study, write_ablation
    from leaderboard.running.jobs import RunSpec
    from leaderboard.running.workers.local_engine import LocalEngine
    from leaderboard.studies.ablation import work_out
    from leaderboard.studies.driving import StudyPlan, drive_study
    from leaderboard.studies.rows import choose_rows

    with requests():
        chosen_rows = choose_rows(rows, only)
        scene, chosen = choose_scene(suite, routes, rules, options)
        name = f"ablation-{plain_name(name_of(agent))}-{plain_name(chosen.name)}"
        folder = Path(output or Path("results") / name)
        spec = specification_of(agent, folder.parent)
        study, interrupted = drive_study(
            StudyPlan(
                kind="ablation",
                spec=RunSpec(agent=spec, options=scene, rules=rules, isolate=isolate),
                suite=chosen,
                rows=chosen_rows,
            ),
            seeds,
            folder=folder,
            engine=LocalEngine(workers=workers),
            keep=lambda so_far: keep_study(folder, so_far),
        )
        keep_study(folder, study)
        ablation = work_out(study)
        write_ablation(folder, ablation)
    return Ablated(ablation=ablation, folder=folder, complete=study.complete and not interrupted)
