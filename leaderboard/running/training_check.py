"""How well a policy drives while it is still being trained: a few routes, closed loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType

from torch import nn
from typing_extensions import Self

from agents.driveinsight.config import PolicyConfig
from agents.training.trainees import Trainee
from agents.training.true_sight import requirements_with_lent_eyes
from leaderboard.running.driver import Driver
from leaderboard.running.jobs import Job, RunSpec
from leaderboard.scoring.score import mean_score

SUITE = "town05_tiny"


class CheckError(Exception):
    """A route of the check could not be driven; says why."""


class ClosedLoopCheck:
    """Drives the first routes of a suite with a policy, as `evaluate` does with seed 0."""

    def __init__(
        self,
        trainee: Trainee,
        folder: Path,
        routes: int,
        *,
        lent_eyes: bool = False,
        stop: Callable[[], bool],
        on_route: Callable[[int], None] = lambda number: None,
    ) -> None:
        """Loads the town.

        Args:
            trainee: What is trained.
            folder: Where the policy is put for its agent to load.
            routes: How many to drive.
            lent_eyes: What truly is in sight stands in for what its sensors would see.
            stop: Asked before each route whether to leave it.
            on_route: Told the number of each route that begins.
        """
        self._trainee, self._folder, self._stop, self._on_route = trainee, folder, stop, on_route
        scheme, needs, config = trainee.scheme, trainee.requires, trainee.config
        if lent_eyes and isinstance(config, PolicyConfig):
            scheme, needs = "true-sight", requirements_with_lent_eyes(config)
        self._driver = Driver(RunSpec(agent=f"{scheme}:{folder}", options={"suite": SUITE}), needs)
        ids = self._driver.env.route_ids[:routes]
        self._jobs = [Job(index=n, route_id=route_id, seed=0) for n, route_id in enumerate(ids)]

    def __call__(self, policy: nn.Module) -> Mapping[str, float] | None:
        """The mean scores; None if asked to stop.

        Raises:
            CheckError: If a route could not be driven.
        """
        self._trainee.save(policy, self._folder, "A policy that is being checked.\n")
        scores = []
        for job in self._jobs:
            if self._stop():
                return None
            self._on_route(job.index + 1)
            record = self._driver.drive(job)
            if record.crashed:
                raise CheckError(f"route {job.route_id}: {record.status}: {record.reason}")
            scores.append(record.score)
        driving, completion, penalty = mean_score(scores)
        return {
            "driving_score": driving,
            "route_completion": completion,
            "infraction_penalty": penalty,
        }

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._driver.__exit__(kind, error, trace)
