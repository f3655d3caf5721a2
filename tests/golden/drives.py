"""Golden drives: short drives of every shipped agent and town, and what is kept of each.

A drive follows recorded controls, while its agent is asked at every decision what it would do. So
the two that may have changed are told apart: if what the recorded controls lead to is not what it
was, the world moved; if it is, and the agent would do otherwise, the agent moved.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import AGENTS, load_agent
from agents.versions import agent_version
from di_envs.differences import differences
from di_envs.route_env import RouteEnv
from di_envs.sensors.camera.config import CameraConfig, Rig
from di_envs.sensors.lidar.config import LidarConfig
from di_envs.world.kinds import ActorKind
from di_envs.world.state import TICK_S
from di_envs.world.world import WorldView
from di_envs.world_version import WORLD_VERSION
from leaderboard.records.episode_hash import EpisodeHash
from leaderboard.records.footing import footing_here
from leaderboard.records.packing import pack, unpack
from leaderboard.running.driver import environment_options
from leaderboard.running.episode import close_agent, extra_keys, plan_shown
from leaderboard.running.jobs import Job

RECORD_COMMAND = "python -m tests.golden.record"
CONTROL_TYPE = "<f4"
CONTROLS = "controls"  # among the hashes, the one that the agent answers for
TOLERANCE = 1e-4  # of metres, radians, m/s and controls, on a CPU that nobody recorded on
LEARNT_TOLERANCE = 0.02  # of a policy's controls: other CPUs add up its float32 in another order
EVENT_TOLERANCE_S = 0.1

EVERY_SENSOR = "every sensor, in rain at night"
_OPTIONS: dict[str, dict[str, Any]] = {
    "": {},
    EVERY_SENSOR: {
        # as recorded: what came later has tests of its own
        "observations": ("prompt", "inertial", "camera", "lidar", "odometry"),
        "cameras": Rig(
            cameras=tuple(
                CameraConfig(name=f"camera_{side}", width=96, height=54, yaw_rad=yaw)
                for side, yaw in (("front", 0.0), ("back", 3.1))
            ),
            depth=True,
            semantic=True,
            instance=True,
        ),
        "lidar": LidarConfig(channels=16, steps=90, noise_m=0.02, semantic=True),
        "weather": "HardRainNight",
    },
}


@dataclass(frozen=True, kw_only=True)
class GoldenDrive:
    """What is driven: the first seconds of a route of a suite.

    Attributes:
        shown: Which of `_OPTIONS` are given to the environment.
    """

    agent: str
    suite: str
    route: str
    seconds: float
    seed: int = 0
    shown: str = ""

    @property
    def settings(self) -> str:
        """All of it as text: with other settings it is another drive."""
        shown = f", {self.shown}" if self.shown else ""
        return f"route {self.route}, seed {self.seed}, {self.seconds:g} s{shown}"

    @property
    def tolerance(self) -> float:
        """By how much the agent's controls may differ on another CPU."""
        return LEARNT_TOLERANCE if AGENTS[self.agent].data else TOLERANCE


GOLDEN: dict[str, GoldenDrive] = {
    "expert on town05_long": GoldenDrive(
        agent="expert", suite="town05_long", route="0", seconds=8.0
    ),
    "expert on town05_short": GoldenDrive(
        agent="expert", suite="town05_short", route="8", seconds=8.0
    ),
    "expert on town05_tiny": GoldenDrive(
        agent="expert", suite="town05_tiny", route="0", seconds=6.0
    ),
    "expert on toy": GoldenDrive(agent="expert", suite="toy", route="4", seconds=9.0, seed=1),
    "expert-blind on toy": GoldenDrive(  # it hits another car
        agent="expert-blind", suite="toy", route="4", seconds=7.0, seed=10
    ),
    "expert-told on town05_short": GoldenDrive(
        agent="expert-told", suite="town05_short", route="0", seconds=4.0
    ),
    "expert-redrunner on toy": GoldenDrive(  # it runs a red light
        agent="expert-redrunner", suite="toy", route="0", seconds=6.0
    ),
    "expert-signrunner on town05_short": GoldenDrive(  # it runs a stop sign
        agent="expert-signrunner", suite="town05_short", route="10", seconds=6.0
    ),
    "constant on toy": GoldenDrive(agent="constant", suite="toy", route="1", seconds=5.0),
    "random on town05_tiny": GoldenDrive(
        agent="random", suite="town05_tiny", route="1", seconds=5.0
    ),
    "highway on town05_short": GoldenDrive(
        agent="highway", suite="town05_short", route="0", seconds=4.0
    ),
    "driveinsight on town05_short": GoldenDrive(
        agent="driveinsight", suite="town05_short", route="8", seconds=3.0
    ),
    "driveinsight-told on town05_short": GoldenDrive(
        agent="driveinsight-told", suite="town05_short", route="8", seconds=3.0
    ),
    "driveinsight-sensors on town05_short": GoldenDrive(
        agent="driveinsight-sensors", suite="town05_short", route="8", seconds=2.0
    ),
    "driveinsight-town05 on town05_short": GoldenDrive(
        agent="driveinsight-town05", suite="town05_short", route="8", seconds=2.0
    ),
    "driveinsight-budget on town05_short": GoldenDrive(
        agent="driveinsight-budget", suite="town05_short", route="8", seconds=2.0
    ),
    "route-only on town05_short": GoldenDrive(
        agent="route-only", suite="town05_short", route="8", seconds=3.0
    ),
    "ego-only on town05_short": GoldenDrive(
        agent="ego-only", suite="town05_short", route="8", seconds=3.0
    ),
    "transfuser on town05_short": GoldenDrive(
        agent="transfuser", suite="town05_short", route="8", seconds=2.0
    ),
    "interfuser on town05_short": GoldenDrive(
        agent="interfuser", suite="town05_short", route="8", seconds=2.0
    ),
    "driveadapter on town05_short": GoldenDrive(
        agent="driveadapter", suite="town05_short", route="8", seconds=2.0
    ),
    "mile on town05_short": GoldenDrive(agent="mile", suite="town05_short", route="8", seconds=2.0),
    "vad on town05_short": GoldenDrive(agent="vad", suite="town05_short", route="8", seconds=2.0),
    "st-p3 on town05_short": GoldenDrive(
        agent="st-p3", suite="town05_short", route="8", seconds=2.0
    ),
    "thinktwice on town05_short": GoldenDrive(
        agent="thinktwice", suite="town05_short", route="8", seconds=2.0
    ),
    "ppo on town05_short": GoldenDrive(agent="ppo", suite="town05_short", route="8", seconds=3.0),
    "lbc-teacher on town05_short": GoldenDrive(
        agent="lbc-teacher", suite="town05_short", route="8", seconds=3.0
    ),
    "lbc on town05_short": GoldenDrive(agent="lbc", suite="town05_short", route="8", seconds=2.0),
    "roach-raster on town05_short": GoldenDrive(
        agent="roach-raster", suite="town05_short", route="8", seconds=3.0
    ),
    "every sensor in rain": GoldenDrive(
        agent="expert", suite="town05_short", route="0", seconds=2.0, shown=EVERY_SENSOR
    ),
}


@dataclass(frozen=True, kw_only=True)
class Driven:
    """What came of a drive.

    Attributes:
        controls: (N, 3) what the agent would do at each decision.
        numbers: Each second: x, y [m], yaw [rad], speed [m/s] of the ego, then how many others
            there are, and their mean x, y and speed.
        events: Names of their kinds, with their times [s].
        hashes: Of all observations, rewards, events and states, which the world gave, and of the
            controls.
    """

    controls: NDArray[np.float32]
    numbers: tuple[tuple[float, ...], ...]
    events: tuple[tuple[str, float], ...]
    hashes: Mapping[str, str]


def drive(golden: GoldenDrive, controls: NDArray[np.float32] | None = None) -> Driven:
    """Drives along recorded controls; without any, as the agent would."""
    agent = load_agent(golden.agent)
    try:
        return _driven(golden, agent, controls)
    finally:
        close_agent(agent)


def _driven(golden: GoldenDrive, agent: Any, controls: NDArray[np.float32] | None) -> Driven:
    options = {"suite": golden.suite, "route_ids": (golden.route,), **_OPTIONS[golden.shown]}
    env = RouteEnv(**environment_options(options, agent.requires))
    job = Job(index=0, route_id=golden.route, seed=golden.seed)
    observation, _ = env.reset(seed=job.world_seed, options={"route": job.route_id})
    memory = agent.start(plan_shown(agent.requires, env.plan), job.world_seed)
    digest, numbers = EpisodeHash(), [_numbers(env.view)]
    chosen, events = list[NDArray[np.float32]](), list[tuple[str, float]]()
    digest.add_observation(observation)
    every, over = round(1.0 / env.config.control_dt_s), False
    recorded: Iterator[Any] = repeat(None) if controls is None else iter(controls)
    while not over and len(chosen) < round(golden.seconds / env.config.control_dt_s):
        seen = {**observation, **extra_keys(agent.requires, env.view)}
        control, memory = agent.act(seen, memory)
        chosen.append(control)
        given = next(recorded, None)
        observation, reward, ended, cut, info = env.step(control if given is None else given)
        digest.add_observation(observation)
        digest.add_reward(float(reward))
        digest.add_events(info["events"])
        digest.add_state(env.view.state, env.view.ego)
        events += [(e.kind.name.lower(), round(e.tick * TICK_S, 2)) for e in info["events"]]
        over = ended or cut
        if len(chosen) % every == 0:
            numbers.append(_numbers(env.view))
    env.close()
    observations, rewards, happened = digest.hex()
    controls = np.array(chosen, CONTROL_TYPE)
    return Driven(
        controls=controls,
        numbers=tuple(numbers),
        events=tuple(events),
        hashes={
            "observations": observations,
            "rewards": rewards,
            "events": happened,
            "states": digest.state_hex(env.view.state),
            CONTROLS: hashlib.blake2b(controls.tobytes(), digest_size=16).hexdigest(),
        },
    )


def _numbers(view: WorldView) -> tuple[float, ...]:
    state, others = view.state, np.flatnonzero(view.state.kind != ActorKind.ABSENT)[1:]
    own = (state.x[0], state.y[0], state.yaw[0], state.speed[0])
    means = [float(values[others].mean()) for values in (state.x, state.y, state.speed)]
    return tuple(round(float(value), 6) for value in (*own, len(others), *means))


def label(golden: GoldenDrive) -> str:
    """The footing on which bits are the same."""
    return ", ".join(f"{name} {version}" for name, version in footing_here(golden.agent).items())


def entry_of(golden: GoldenDrive, driven: Driven) -> dict[str, Any]:
    """A drive as it is written down, as JSON values."""
    return {
        "settings": golden.settings,
        "world_version": WORLD_VERSION,
        "agent_version": agent_version(golden.agent),
        "controls": pack(driven.controls, CONTROL_TYPE),
        "numbers": [list(row) for row in driven.numbers],
        "events": [list(event) for event in driven.events],
        "exact": {label(golden): dict(driven.hashes)},
    }


def recorded_controls(entry: Mapping[str, Any]) -> NDArray[np.float32]:
    """(N, 3) the controls that a golden drive follows."""
    return unpack(entry["controls"], CONTROL_TYPE, 3)


def outdated(golden: GoldenDrive, entry: Mapping[str, Any]) -> str:
    """Why a record is not of today's drive; empty if it is, so that the two must be the same."""
    now = {
        "settings": golden.settings,
        "world_version": WORLD_VERSION,
        "agent_version": agent_version(golden.agent),
    }
    said = "; ".join(found.was_is for found in differences({n: entry[n] for n in now}, now))
    return f"{said}: record the golden drives anew with {RECORD_COMMAND}" if said else ""


def moved(name: str, entry: Mapping[str, Any], driven: Driven, *, bits: bool) -> str:
    """What moved though no version says so, and which one to raise; empty if nothing did.

    Args:
        name: Of the golden drive.
        entry: Its record.
        driven: The drive along the recorded controls.
        bits: Whether to compare bits too, as can be on a footing that was recorded on.
    """
    golden = GOLDEN[name]
    exact = entry["exact"][label(golden)] if bits else {}
    other = [key for key, value in exact.items() if driven.hashes[key] != value]
    world = [key for key in other if key != CONTROLS]
    if what := f"other bits of {', '.join(world)}" if world else _world_moved(entry, driven):
        return _said(name, f"the world moved ({what})", "WORLD_VERSION in di_envs/world_version.py")
    what = _agent_moved(recorded_controls(entry), driven.controls, golden.tolerance)
    if what or CONTROLS in other:
        version = f"the version of '{golden.agent}' in AGENTS of agents/table.py"
        return _said(name, f"the agent moved ({what or 'other bits of controls'})", version)
    return ""


def _said(name: str, what: str, version: str) -> str:
    return (
        f"{name}: {what}. If that is meant, raise {version}, and record the golden drives anew "
        f"with {RECORD_COMMAND}"
    )


def _world_moved(entry: Mapping[str, Any], driven: Driven) -> str:
    if len(entry["numbers"]) != len(driven.numbers):
        return f"{len(driven.numbers)} seconds were driven, not {len(entry['numbers'])}"
    for second, (was, now) in enumerate(zip(entry["numbers"], driven.numbers, strict=True)):
        if not np.allclose(was, now, rtol=0.0, atol=TOLERANCE):
            return f"after {second} s there was {was}, there is {list(now)}"
    kinds = [[kind for kind, _ in events] for events in (entry["events"], driven.events)]
    times = [[time_s for _, time_s in events] for events in (entry["events"], driven.events)]
    if kinds[0] != kinds[1] or not np.allclose(*times, rtol=0.0, atol=EVENT_TOLERANCE_S):
        return f"events were {entry['events']}, are {[list(event) for event in driven.events]}"
    return ""


def _agent_moved(was: NDArray[np.float32], now: NDArray[np.float32], tolerance: float) -> str:
    if was.shape != now.shape:
        return f"it decided {len(now)} times, not {len(was)}"
    apart = np.flatnonzero(np.abs(was - now).max(axis=1) > tolerance)
    if not len(apart):
        return ""
    first = int(apart[0])
    return f"at decision {first} it did {was[first].tolist()}, it does {now[first].tolist()}"
