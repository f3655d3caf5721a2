"""What a policy responded to over one recorded drive: a table of moments."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.base import Agent
from agents.explain.responses import Response, responses_at
from agents.explain.situations import SITUATIONS, situations_of
from di_envs.route_env import RouteEnv
from di_envs.rules import rules_named
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.recorded_agent import RetraceError, retrace_env
from leaderboard.replaying.retracing import retrace
from leaderboard.scoring.names import EVENT_NAMES

EVERY_S = 0.5  # between two moments that are looked at, unless told otherwise


@dataclass(frozen=True, kw_only=True)
class DriveResponses:
    """Responses at N moments of a drive, to G components.

    Attributes:
        route_id: Of the route.
        seed: As the run counts them.
        agent: As the run names it, with its interventions.
        drive: A hash of the record: whether this belongs to it can be told.
        route_hash: Of the route's plan: the same route may be driven under two ids.
        every_s: Between two moments [s].
        events: (time [s], name) of what the rules counted.
        groups: The components' names.
        situations: The situations' names.
        time_s: (N,) game time.
        speed_mps: (N,) of the ego.
        gradient: (N, G, 2) Gx and Gy, see `agents.explain.responses`.
        attention: (N, layers, heads, G) shares; no layers for a policy without attention.
        waypoints: (N, T, 2) x ahead, y right of the ego then [m].
        holds: (N, S) which situations held.
    """

    route_id: str
    seed: int
    agent: str
    drive: str
    route_hash: str
    every_s: float
    events: tuple[tuple[float, str], ...]
    groups: tuple[str, ...]
    situations: tuple[str, ...]
    time_s: NDArray[np.float64]
    speed_mps: NDArray[np.float32]
    gradient: NDArray[np.float32]
    attention: NDArray[np.float32]
    waypoints: NDArray[np.float32]
    holds: NDArray[np.bool_]

    @property
    def strength(self) -> NDArray[np.float64]:
        """(N, G) length of (Gx, Gy): how much either coordinate responds."""
        return np.linalg.norm(self.gradient.astype(np.float64), axis=2)

    def holding(self, situation: str) -> NDArray[np.bool_]:
        """(N,) where a situation held."""
        return self.holds[:, self.situations.index(situation)]

    @property
    def share(self) -> NDArray[np.float64]:
        """(N, G) of the strength of all components together."""
        strength = self.strength
        whole = strength.sum(axis=1, keepdims=True)
        return np.divide(strength, whole, out=np.zeros_like(strength), where=whole > 0.0)

    @property
    def name(self) -> str:
        """The agent without the folders that its weights lie in."""
        return re.sub(r"[^:;\s]*/", "", self.agent)

    @property
    def title(self) -> str:
        """`route 3, seed 0`."""
        return f"route {self.route_id}, seed {self.seed}"


def drive_responses(
    run: RunRecord,
    record: RouteRecord,
    agent: Agent[Any],
    *,
    every_s: float = EVERY_S,
    env: RouteEnv | None = None,
    on_decision: Callable[[float], None] = lambda time_s: None,
) -> DriveResponses:
    """Drives a recorded route again and looks at every n-th decision.

    Args:
        run: The run.
        record: The route.
        agent: From `recorded_agent.run_agent`.
        every_s: Time between two looks, rounded to whole decisions.
        env: From `retrace_env(run, prompt=True)`; None makes one.
        on_decision: Told the game time of each decision.

    Raises:
        NotExplainableError: If the agent's policy cannot be looked into.
        RetraceError: If the agent does not drive as recorded.
        ReplayError: If the route cannot be replayed here.
    """
    env = env or retrace_env(run, prompt=True)
    every = max(1, round(every_s / env.config.control_dt_s))
    times, speeds, responses, holds = [], [], [], []
    for decision in retrace(run, record, agent=agent, env=env):
        on_decision(decision.time_s)
        if decision.number % every or decision.control is None:
            continue
        step = decision.step
        found = situations_of(step.observation, decision.context.junction_m)
        responses.append(responses_at(agent, decision.seen, decision.memory))
        times.append(step.time_s)
        speeds.append(float(step.view.state.speed[step.view.ego]))
        holds.append([found[name] for name in SITUATIONS])
    if not responses:
        raise RetraceError(f"nothing was driven of route {record.route_id}, seed {record.seed}")
    return DriveResponses(
        route_id=record.route_id,
        seed=record.seed,
        agent=run.title,
        drive=drive_hash(record),
        route_hash=record.route_hash,
        every_s=every * env.config.control_dt_s,
        events=_events(run, record),
        groups=responses[0].groups,
        situations=SITUATIONS,
        time_s=np.array(times),
        speed_mps=np.array(speeds, np.float32),
        gradient=_stacked(responses, "gradient"),
        attention=_stacked(responses, "attention"),
        waypoints=_stacked(responses, "waypoints"),
        holds=np.array(holds, bool),
    )


def plain_words(name: str) -> str:
    """`stop sign` of `stop_sign`: a component or situation as people read it."""
    return name.replace("_", " ")


def drive_hash(record: RouteRecord) -> str:
    """Of all that a drive was, but for the time that it took."""
    return hashlib.blake2b(repr(record.fingerprint()).encode(), digest_size=8).hexdigest()


def _events(run: RunRecord, record: RouteRecord) -> tuple[tuple[float, str], ...]:
    counted = rules_named(run.rules).infractions
    return tuple((e.time_s, EVENT_NAMES[e.kind]) for e in record.events if e.kind in counted)


def _stacked(responses: list[Response], name: str) -> NDArray[np.float32]:
    return np.stack([getattr(response, name) for response in responses])
