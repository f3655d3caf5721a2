"""What is kept of a run: values that a file, a table or another run can be made from.

Everything but the wall-clock time is a function of (agent, options, route, seed): `fingerprint`
leaves that out, so two runs are the same exactly when their fingerprints are.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.world.state import EventKind
from leaderboard.records.packing import unpack
from leaderboard.scoring.score import Score

# CARLA's statuses of routes that code ended, not driving
NOT_SET_UP = "Failed - Agent couldn't be set up"
SENSORS_INVALID = "Failed - Agent's sensors were invalid"
AGENT_CRASHED = "Failed - Agent crashed"
SIMULATION_CRASHED = "Failed - Simulation crashed"
# Ours, for routes whose worker process died, and those that took too long by the clock on the wall
WORKER_DIED = "Failed - Worker died"
OUT_OF_TIME = "Failed - Wall-clock limit"
# Ours, for routes of a file that could not be planned; nobody drove them
NOT_PLANNED = "Failed - Route could not be planned"
# What says nothing of the driving: such routes are left out of every mean and every pair
LOST = frozenset({SIMULATION_CRASHED, WORKER_DIED, OUT_OF_TIME})

CONTROL_TYPE = "<f4"  # of the numbers packed in `RouteRecord.controls`
CHECK_TYPE = "<u4"  # of those in `RouteRecord.observation_checks`
TRACE_S = 0.5  # between two rows of a trace

# time [s], x, y, z [m], yaw [rad], speed [m/s] of the ego, rounded to three decimals
TraceRow = tuple[float, float, float, float, float, float]


_NO_CONTROLS: NDArray[np.float32] = np.zeros((0, 3), np.float32)


@dataclass(frozen=True, kw_only=True)
class EventRecord:
    """Something that the rules count, with its time and place (world frame)."""

    kind: EventKind
    tick: int
    time_s: float
    x: float
    y: float
    z: float
    other: int = -1  # the other actor, the signal, or -1
    other_type: str = ""  # CARLA's name of such an actor, such as `vehicle.car`
    value: float = 0.0  # metres for OUTSIDE_LANES


@dataclass(frozen=True, kw_only=True)
class Bound:
    """What a perfect driver gets on the route with these lights and no traffic.

    Attributes:
        route_completion: RC in percent when it finishes or the route times out; also its DS, as it
            commits no infraction.
        finish_s: Game time at which it finishes; None when it cannot.
        stopped_s: Time for which it stood still.
    """

    route_completion: float
    finish_s: float | None
    stopped_s: float


@dataclass(frozen=True, kw_only=True)
class RouteRecord:
    """One route driven once.

    Attributes:
        index: Position in the run, counted over routes and seeds.
        world_seed: What the environment was seeded with, a function of `seed` and `route_id`.
        status: CARLA's status, such as `Completed` or `Failed - Agent timed out`.
        reason: Why it failed, in a sentence, where the status alone does not say.
        keypoints_m: Length of the polyline of the route file's keypoints.
        travelled_m: Route metres over which metres outside lanes were counted.
        wall_s: Wall-clock time that it took; the only thing here that a rerun changes.
        observation_hash: BLAKE2b of every observation in order; so the other two.
        interventions: What was done to the world or to what the agent saw, as text.
        weather: What cameras saw, but for interventions: a preset, or the keyframes that the route
            file has; empty in records from before it was kept.
        scenarios: How many scenarios of each type were triggered.
        state_hash: Of the ego at every decision, and of the whole world at the end.
        controls: Every control carried out, packed; see `control_array`.
        observation_checks: A short hash of every observation, packed; see `check_array`.
        trace: Where the ego was, every half second and at the end.
    """

    route_id: str
    seed: int
    index: int
    world_seed: int
    status: str
    reason: str = ""
    score: Score
    length_m: float
    keypoints_m: float
    done_m: float
    travelled_m: float
    game_s: float
    steps: int
    wall_s: float
    bound: Bound | None
    events: tuple[EventRecord, ...] = ()
    route_hash: str
    observation_hash: str
    reward_hash: str
    event_hash: str
    interventions: tuple[str, ...] = ()
    weather: str = ""
    scenarios: Mapping[str, int] = field(default_factory=dict)
    state_hash: str = ""
    controls: str = ""
    observation_checks: str = ""
    trace: tuple[TraceRow, ...] = ()

    def control_array(self) -> NDArray[np.float32]:
        """(N, 3) throttle, steer, brake of every decision. ValueError if they are damaged."""
        return unpack(self.controls, CONTROL_TYPE, 3) if self.controls else _NO_CONTROLS

    def check_array(self) -> NDArray[np.uint32]:
        """(N + 1,) `observation_check` of what the agent saw before each decision, and at the end.

        Raises:
            ValueError: If they are damaged.
        """
        if not self.observation_checks:
            return np.zeros(0, np.uint32)
        return unpack(self.observation_checks, CHECK_TYPE, 1)[:, 0]

    @property
    def crashed(self) -> bool:
        """Whether code failed, the agent's or the simulator's, rather than the driving."""
        return bool(self.reason)

    @property
    def lost(self) -> bool:
        """Whether the machinery failed: the record says nothing of the driving."""
        return self.status in LOST

    def fingerprint(self) -> tuple[Any, ...]:
        """All that a rerun must give again, bit for bit."""
        values = dataclasses.asdict(dataclasses.replace(self, wall_s=0.0))
        return tuple(sorted((name, repr(value)) for name, value in values.items()))


def undriven_record(**known: Any) -> RouteRecord:
    """A route of which nothing more than this is known, as nobody drove it to any end."""
    values: dict[str, Any] = {
        "world_seed": 0,
        "score": Score(route_completion=0.0, infraction_score=1.0),
        "steps": 0,
        "bound": None,
        **dict.fromkeys(("length_m", "keypoints_m", "done_m", "travelled_m", "game_s"), 0.0),
        **dict.fromkeys(("route_hash", "observation_hash", "reward_hash", "event_hash"), ""),
        "wall_s": 0.0,
        **known,
    }
    return RouteRecord(**values)


@dataclass(frozen=True, kw_only=True)
class RunRecord:
    """A run of one agent over routes and seeds, finished or not.

    Attributes:
        agent_version: Tells the agent from others of its name; see `agents.versions`.
        suite_version: 0 for routes of the user's own.
        options: Environment options that differ from the defaults.
        versions: Package name to version, for all that can change bits; `world` is our own
            `WORLD_VERSION`. Python's and ours are there for information.
        cpu: CPU capability that the kernels were compiled for.
        routes_hash: Of the ids and points of all routes that the run is over.
        world: What its suite was made of, by content: see `di_envs.suite_files.content_of`; empty
            in records from before it was kept.
        isolated: Whether an agent that is not ours drove in a process of its own.
        planned: Number of (route, seed) pairs that were asked for.
        interventions: What was edited of what the agent saw, in every route, as text.
        refused: Why routes of the file could not be planned, by their id; `planned` is without.
        notes: What else is to be known of it: what was left out of the file, what was chosen.
        routes: Those driven, by `index`.
    """

    rules: str
    agent: str
    agent_version: str
    track: str
    requires: Mapping[str, Any]
    suite: str
    suite_version: int
    options: Mapping[str, Any]
    town: str
    town_hash: str
    routes_hash: str
    seeds: tuple[int, ...]
    versions: Mapping[str, str]
    cpu: str
    planned: int
    interventions: tuple[str, ...] = ()
    world: Mapping[str, str] = field(default_factory=dict)
    isolated: bool = False
    refused: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    routes: tuple[RouteRecord, ...] = ()

    @property
    def title(self) -> str:
        """The agent, and what was edited of what it saw."""
        edits = "; ".join(self.interventions)
        return f"{self.agent} with {edits}" if edits else self.agent

    @property
    def complete(self) -> bool:
        return len(self.routes) == self.planned

    @property
    def scored(self) -> tuple[RouteRecord, ...]:
        """The routes that were driven: what means, rates and pairs are made of."""
        return tuple(record for record in self.routes if not record.lost)

    @property
    def lost(self) -> tuple[RouteRecord, ...]:
        """The routes that the machinery failed to drive, and their reasons."""
        return tuple(record for record in self.routes if record.lost)
