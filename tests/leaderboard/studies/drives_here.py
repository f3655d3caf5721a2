"""For tests of studies: an engine that drives in this process, and studies made by hand."""

from __future__ import annotations

import os
import signal
from collections import deque
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path

from leaderboard.running.jobs import Job, RunSpec
from leaderboard.running.messages import Driven, EngineEvent, Ready, Started
from leaderboard.running.setting_up import scene_of, set_up
from leaderboard.running.wall_clock import Stopwatch
from leaderboard.studies.record import DrivenRow, Study, StudyDrive
from leaderboard.studies.rows import ABLATION_ROWS, BASELINE_ROW, NULL_ROW

FOLLOWER = f"{Path(__file__).parents[1] / 'route_followers.py'}:RouteFollower"


@dataclass
class HereEngine:
    """Real drives, one after the other, without the seconds that a process takes to start.

    Attributes:
        stop_after: So many drives in, Ctrl-C is pressed; 0 for never.
        driven: How many there have been.
    """

    stop_after: int = 0
    driven: int = 0

    def run(self, spec: RunSpec, jobs: deque[Job]) -> Generator[EngineEvent]:
        driver = set_up(spec, Stopwatch())
        yield Ready(scene=scene_of(driver))
        with driver:
            while jobs:
                job = jobs.popleft()
                yield Started(job=job)
                self.driven += 1
                if self.driven == self.stop_after:
                    os.kill(os.getpid(), signal.SIGINT)
                yield Driven(job=job, record=driver.drive(job))


def drive(route: str = "0", seed: int = 0, ds: float = 90.0, **fields: object) -> StudyDrive:
    """A drive whose route is complete: its score is its penalty's."""
    values = {
        "route_hash": f"hash of {route}",
        "driving_score": ds,
        "route_completion": 100.0,
        "infraction_score": ds / 100.0,
        "done_m": 1000.0,
        "game_s": 100.0,
        "wall_s": 2.0,
        "status": "Completed",
        "episode": f"{route} {seed} {ds}",
        **fields,
    }
    return StudyDrive(route_id=route, seed=seed, **values)  # type: ignore[arg-type]


def row(name: str, *drives: StudyDrive, left_out: str = "") -> DrivenRow:
    """A row of an ablation, or the baseline or the null row, with these drives."""
    known = {each.name: each for each in (BASELINE_ROW, NULL_ROW, *ABLATION_ROWS)}
    return DrivenRow(row=known[name], planned=len(drives), drives=drives, left_out=left_out)


def study(*rows: DrivenRow, **fields: object) -> Study:
    values = {
        "kind": "ablation",
        "agent": "mine.py:Mine",
        "agent_version": "ab",
        "track": "PROMPT",
        "requires": {"observations": ["prompt"]},
        "suite": "town05_short",
        "suite_version": 1,
        "options": {"suite": "town05_short"},
        "rules": "carla-1.0",
        "town": "town05",
        "town_hash": "cd",
        "routes_hash": "ef",
        "interventions": (),
        "versions": {"python": "3.11", "numpy": "2.4.6", "world": "1"},
        "cpu": "generic",
        "seeds": (0,),
        **fields,
    }
    return Study(rows=rows, **values)  # type: ignore[arg-type]
