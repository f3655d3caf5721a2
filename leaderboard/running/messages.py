"""What workers and engines tell: values, so that they go through pipes and over networks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from agents.base import Requirements
from leaderboard.records.record import RouteRecord
from leaderboard.running.jobs import Job


@dataclass(frozen=True, kw_only=True)
class RunFacts:
    """What a worker learns of a run before it drives, and what machine it is on."""

    requires: Requirements
    agent_version: str
    town: str
    town_hash: str
    route_ids: tuple[str, ...]
    routes_hash: str
    versions: Mapping[str, str]
    cpu: str
    world: Mapping[str, str] = field(default_factory=dict)
    refused: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Ready:
    """A worker is ready to drive. From an engine: the first is, and jobs may be given to it."""

    scene: RunFacts


@dataclass(frozen=True, kw_only=True)
class Refused:
    """A worker cannot do this run: the agent, the town or an option is wrong."""

    reason: str


@dataclass(frozen=True, kw_only=True)
class Compiling:
    """A kernel is being compiled, or (with no name) all are that a drive needs."""

    kernel: str = ""
    done: int = 0
    total: int = 0


@dataclass(frozen=True, kw_only=True)
class Warned:
    """A warning that a worker met."""

    text: str


@dataclass(frozen=True, kw_only=True)
class Started:
    """A job was handed to a worker."""

    job: Job


@dataclass(frozen=True, kw_only=True)
class Driven:
    """A job is done; its record says how."""

    job: Job
    record: RouteRecord


@dataclass(frozen=True, kw_only=True)
class Lost:
    """A job is not done: its worker died, or was killed as it took too long."""

    job: Job
    status: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class Died:
    """A worker is no more; `status` is what its job ends with, if it had one."""

    status: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class Pause:
    """Nothing happened for a moment; said so that whoever listens can stop the run."""


WorkerMessage = Ready | Refused | Compiling | Warned | Driven | Died
EngineEvent = Ready | Compiling | Warned | Started | Driven | Lost | Pause
