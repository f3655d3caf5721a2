"""The first seconds of a drive as a run of its own: what a test needs of one, in little time."""

from __future__ import annotations

import dataclasses
from typing import Any

from gymnasium.wrappers import TimeLimit

from di_envs.rules import rules_named
from di_envs.suites import load_suite
from leaderboard.records.record import RunRecord
from leaderboard.running.episode import drive_route
from leaderboard.running.interventions import read_interventions
from leaderboard.running.jobs import Job, RunSpec
from leaderboard.running.runner import new_run
from leaderboard.running.setting_up import scene_of, set_up
from leaderboard.running.wall_clock import Stopwatch


def short_run(
    agent: str,
    decisions: int,
    *,
    suite: str = "toy",
    route_id: str = "",
    seed: int = 0,
    interventions: tuple[str, ...] = (),
    **options: Any,
) -> RunRecord:
    """A run of the first decisions of one route, the suite's first where none is named."""
    route_id = route_id or load_suite(suite).specs()[0].route_id
    options = {"suite": suite, "route_ids": (route_id,), **options}
    edits = read_interventions("; ".join(interventions))
    spec = RunSpec(agent=agent, options=options, interventions=edits)
    job = Job(index=0, route_id=route_id, seed=seed)
    with set_up(spec, Stopwatch()) as driver:
        scene = scene_of(driver)
        record = drive_route(
            driver.interventions.around(TimeLimit(driver.env, decisions)),
            lambda: driver.interventions.agent(agent),
            job,
            rules_named(spec.rules),
            requires=driver.requires,
            interventions=interventions,
        )
    run = new_run(spec, [job], load_suite(suite), scene)
    return dataclasses.replace(run, routes=(record,))
