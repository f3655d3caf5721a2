"""A run as independent jobs: each drives one route with one seed, and knows nothing of the rest."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wrappers.interventions.edit import ObservationEdit


class SetupError(Exception):
    """The run cannot start: the agent, the town or an option is wrong; says what to do."""


@dataclass(frozen=True, kw_only=True)
class RunSpec:
    """What all jobs of a run share; small, so that it travels to worker processes.

    Attributes:
        agent: An agent's name, `module:Class` or `path/to/file.py:Class`.
        options: Environment options; what the agent requires is added to them.
        rules: Name of the scoring rules.
        interventions: What is edited of what the agent sees.
        isolate: Whether an agent that is not ours drives in a process of its own.
    """

    agent: str
    options: Mapping[str, Any] = field(default_factory=dict)
    rules: str = "carla-1.0"
    interventions: tuple[ObservationEdit, ...] = ()
    isolate: bool = True


@dataclass(frozen=True, kw_only=True)
class Job:
    """One route, driven once."""

    index: int
    route_id: str
    seed: int

    @property
    def world_seed(self) -> int:
        """The seed of the job's world: a hash of (seed, route), so the order of jobs is free."""
        key = f"{self.seed}\0{self.route_id}".encode()
        return int.from_bytes(hashlib.blake2b(key, digest_size=4).digest(), "little")


def plan_jobs(route_ids: Sequence[str], seeds: Sequence[int]) -> list[Job]:
    """Every route with every seed, numbered as CARLA numbers repetitions: routes outermost.

    Raises:
        ValueError: If there is no route or no seed, or one of them stands there twice.
    """
    for name, values in (("route", route_ids), ("seed", seeds)):
        if not values:
            raise ValueError(f"there is no {name} to evaluate: give at least one")
        if len(set(values)) < len(values):
            raise ValueError(f"a {name} is given twice: {', '.join(map(str, values))}")
    pairs = [(route_id, seed) for route_id in route_ids for seed in seeds]
    return [Job(index=i, route_id=pair[0], seed=pair[1]) for i, pair in enumerate(pairs)]
