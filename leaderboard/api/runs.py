"""`evaluate` and `load_run`: an agent over routes and seeds, and what came of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from leaderboard.api.given_agents import GivenAgent, name_of, specification_of
from leaderboard.api.requests import RequestError, requests
from leaderboard.api.shown import Shown
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.scoring.names import EVENT_NAMES
from leaderboard.statistics.confidence import mean_interval
from leaderboard.tables.run_tables import seed_means

Routes = Sequence[str | int] | str | int


@dataclass(frozen=True, kw_only=True, repr=False)
class Run(Shown):
    """An agent over routes and seeds, finished or not.

    Attributes:
        record: All that is kept of it, with the routes driven.
        folder: Where its files are; the commands take it as RUN.
        trusted: Whether its agent and edits may be loaded: they were given here, or somebody said
            so.
    """

    record: RunRecord
    folder: Path
    trusted: bool = False

    @property
    def driving_score(self) -> float:
        """0 to 100, the mean over routes and seeds; NaN where none was finished."""
        return self._mean("driving_score")

    @property
    def route_completion(self) -> float:
        """In percent, likewise."""
        return self._mean("route_completion")

    @property
    def infraction_score(self) -> float:
        """0 to 1, likewise."""
        return self._mean("infraction_score")

    @property
    def complete(self) -> bool:
        """Whether all is driven; else `evaluate(…, output=run.folder, resume=True)` goes on."""
        return self.record.complete

    @property
    def title(self) -> str:
        """Who, where, how well, and how much of it."""
        run = self.record
        done = f"{len(run.routes)} of {run.planned} routes"
        return (
            f"Run of {run.title} on {run.suite}: DS {self.driving_score:.1f}, "
            f"RC {self.route_completion:.1f}, IS {self.infraction_score:.2f}; {done}; {self.folder}"
        )

    def rows(self) -> list[dict[str, Any]]:
        """A row for each route and seed."""
        return [_row(record) for record in self.record.routes]

    def _mean(self, score: str) -> float:
        means = seed_means(self.record.scored, score, self.record.seeds)
        return mean_interval(means).mean if means else float("nan")


def _row(record: RouteRecord) -> dict[str, Any]:
    counts = Counter(EVENT_NAMES[event.kind] for event in record.events)
    return {
        "route": record.route_id,
        "seed": record.seed,
        "driving_score": record.score.driving_score,
        "route_completion": record.score.route_completion,
        "infraction_score": record.score.infraction_score,
        "length_m": record.length_m,
        "game_s": record.game_s,
        "status": record.status,
        "events": ", ".join(f"{name} x {n}" if n > 1 else name for name, n in counts.items()),
        "reason": record.reason,
    }


def load_run(path: Path | str, *, trust: bool = False) -> Run:
    """A run that was driven before.

    Args:
        path: Its folder.
        trust: Its agent and edits may be loaded by `explain` and `branch`, even if they are code
            that is not ours.

    Raises:
        RequestError: If there is none, or it is damaged.
    """
    from leaderboard.records.results import read_run, run_folder

    with requests():
        folder = run_folder(Path(path))
        return Run(record=read_run(folder), folder=folder, trusted=trust)


def evaluate(
    agent: GivenAgent,
    suite: str | None = None,
    *,
    seeds: int | Sequence[int] = 1,
    routes: Routes = (),
    rules: str = "carla-1.0",
    intervene: str = "",
    workers: int = 1,
    output: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    isolate: bool = True,
    trust: bool = False,
    **options: Any,
) -> Run:
    """Drives an agent over routes and seeds, as `driveinsight evaluate` does.

    Ctrl-C, or a notebook's stop button, ends it early: what is driven is kept and returned.

    Args:
        agent: A name or a place in code, as for `--agent`; or a class or an instance of your own,
            typed into a notebook for example. It is sent to the processes that drive by value.
        suite: Where; see `driveinsight suites`.
        seeds: How many, or which ones.
        routes: Ids of those to drive; all when empty.
        rules: What the scores go by.
        intervene: Edits of what the agent sees, joined by `;`.
        workers: Processes to drive in; the results are the same bits for any number.
        output: Folder for the result files; None for a new one in `results/`.
        resume: Go on with the run that the folder holds.
        overwrite: Replace it.
        isolate: Drive an agent that is not ours in a process of its own.
        trust: Load a model that holds pickles and is not of your own making.
        options: Of the environment, such as `traffic=20`; `route_file` is its `routes`.

    Raises:
        RequestError: If the agent, an option or the folder is wrong.
        KeyboardInterrupt: If it was stopped before anything was driven.
    """
    from leaderboard.commands.evaluate import default_folder, remove_if_empty
    from leaderboard.commands.trusting import check_model
    from leaderboard.running.interventions import read_interventions
    from leaderboard.running.jobs import RunSpec
    from leaderboard.running.runner import evaluate as run_jobs
    from leaderboard.running.workers.local_engine import LocalEngine

    with requests():
        existing = _existing(resume, overwrite)
        scene, chosen = choose_scene(suite, routes, rules, options)
        folder = Path(output or default_folder(name_of(agent), chosen.name, last=resume))
        spec = specification_of(agent, folder.parent)
        if isinstance(agent, str):
            check_model(spec, trust=trust)
        run = RunSpec(
            agent=spec,
            options=scene,
            rules=rules,
            interventions=read_interventions(intervene) if intervene else (),
            isolate=isolate,
        )
        new = not folder.exists()
        try:
            record = run_jobs(
                run,
                range(seeds) if isinstance(seeds, int) else seeds,
                suite=chosen,
                folder=folder,
                engine=LocalEngine(workers=workers),
                existing=existing,
            )
        finally:
            if new:
                remove_if_empty(folder)
    return Run(record=record, folder=folder, trusted=True)


def _existing(resume: bool, overwrite: bool) -> Any:
    from leaderboard.running.runner import Existing

    if resume and overwrite:
        raise RequestError("resume and overwrite exclude each other: choose one")
    if resume:
        return Existing.RESUME
    return Existing.OVERWRITE if overwrite else Existing.REFUSE


def choose_scene(
    suite: str | None, routes: Routes, rules: str, options: dict[str, Any]
) -> tuple[dict[str, Any], Any]:
    """The environment's options and the suite, checked as far as goes without its town.

    Raises:
        ValueError: If an option is wrong, with what to do.
        OSError: If a file is not there.
    """
    from di_envs.config import RouteEnvConfig
    from di_envs.suites import choose_suite

    scene = {"suite": suite, "routes": options.pop("route_file", None), "rules": rules, **options}
    scene = {name: value for name, value in scene.items() if value is not None}
    ids = (routes,) if isinstance(routes, str | int) else tuple(routes)
    if ids:
        scene["route_ids"] = tuple(map(str, ids))
    RouteEnvConfig.from_mapping(scene)
    files = {name: scene.get(name) for name in ("town", "routes", "signals", "scenarios")}
    chosen = choose_suite(suite, **files)
    chosen.specs(chosen.town_path.stem, scene.get("route_ids"))
    return scene, chosen
