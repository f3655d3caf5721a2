"""Drives a recorded route again without its policy: the recorded controls, in the same world.

A world is a function of (options, route, seed, controls), so a replay goes through the same states,
bit for bit, with the same events and the same end. It looks at nothing it need not, so it is much
faster than the drive was. On other package versions or another CPU the bits may differ.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.base import SENSOR_OPTIONS, Requirements, sensors_of_json
from di_envs.edits.text import EditError
from di_envs.route_env import RouteEnv
from di_envs.world.state import TICK_S
from di_envs.world.world import Event, WorldView
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.recorded_edits import timed_edits
from leaderboard.replaying.timed_edits import EditPlan, decisions_before
from leaderboard.running.finished_route import route_hash
from leaderboard.running.jobs import Job
from leaderboard.running.log import EpisodeLog

CHEAPEST = ("inertial",)  # the group of observations that costs least


class ReplayError(Exception):
    """A record that cannot be replayed here; the message says why."""


@dataclass(frozen=True, kw_only=True)
class ReplayStep:
    """A moment of a replay: the start, or what a decision led to.

    Attributes:
        decision: How many decisions have been carried out: 0 at the start.
        time_s: Game time.
        control: (3,) throttle, steer, brake of the last decision; None at the start.
        observation: What the environment shows, of the groups that it was made with.
        view: The present world. It shows the next moment once the next step is asked for: copy
            what you keep.
        events: What happened in this step.
        reward: Of this step.
        info: As `RouteEnv.step` returns it.
        over: Whether the episode has ended.
    """

    decision: int
    time_s: float
    control: NDArray[np.float32] | None
    observation: Mapping[str, Any]
    view: WorldView
    events: tuple[Event, ...]
    reward: float
    info: Mapping[str, Any]
    over: bool


def replay_env(
    run: RunRecord, *, observations: tuple[str, ...] = CHEAPEST, **options: Any
) -> RouteEnv:
    """An environment with the run's options, in which its routes can be replayed.

    Args:
        run: The run.
        observations: Groups of observations to make instead of those that the agent had.
        options: Further arguments of `RouteEnv`, such as `render_mode` or `cameras`.

    Raises:
        ReplayError: If this town is not the run's, or an option or file is not to be had here.
    """
    seen_only = ("observations", *SENSOR_OPTIONS)  # all that an agent may have asked for
    kept = {name: value for name, value in run.options.items() if name not in seen_only}
    kept["control_dt_s"] = run.options.get("control_dt_s", required(run).control_dt_s)
    try:
        env = RouteEnv(**{**kept, "observations": observations, **options})
    except (ValueError, OSError) as error:
        raise ReplayError(f"the run's environment cannot be made here: {error}") from error
    if env.world.town.content_hash != run.town_hash:
        raise ReplayError(
            f"the run was driven in a town with hash {run.town_hash}, '{env.world.town.name}' here "
            f"has {env.world.town.content_hash}: give it the same map and signals"
        )
    return env


def required(run: RunRecord) -> Requirements:
    """What a run's agent required, of what an agent may ask for.

    Raises:
        ReplayError: If the record says of it what this program does not know.
    """
    said = {"branchable": True, **run.requires}  # records do not say that
    options = said.get("options")
    if isinstance(options, Mapping):
        said["options"] = {name: options[name] for name in SENSOR_OPTIONS if name in options}
    try:
        return Requirements.of_json(said)
    except ValueError as error:
        raise ReplayError(f"the record's {error}") from error


def sensor_options(run: RunRecord) -> dict[str, Any]:
    """Arguments for `replay_env` that make it show what the agent saw, bit for bit.

    Raises:
        ReplayError: If the record says of a sensor what this program does not know.
    """
    asked = required(run)
    try:
        own = {name: run.options[name] for name in SENSOR_OPTIONS if name in run.options}
        return {"observations": asked.observations, **asked.options, **sensors_of_json(own)}
    except ValueError as error:
        raise ReplayError(f"the record's sensors cannot be made here: {error}") from error


def replay(
    run: RunRecord, record: RouteRecord, *, env: RouteEnv | None = None
) -> Iterator[ReplayStep]:
    """Drives a recorded route again, decision by decision.

    Args:
        run: The run that the record is of.
        record: The route.
        env: From `replay_env(run)`, so that several routes may share it; None makes one.

    Yields:
        The start, then the moment after each decision.

    Raises:
        ReplayError: If the route is not the recorded one, or the record goes on after its end.
        EditError: If what was done to the world cannot be done here.
    """
    controls = _controls(record)
    env = env or replay_env(run)
    edits = _edits(record, env)
    observation, info = _reset(env, record)
    if edits.apply(env, 0):
        observation = env.observe()
    yield ReplayStep(
        decision=0,
        time_s=0.0,
        control=None,
        observation=observation,
        view=env.view,
        events=(),
        reward=0.0,
        info=info,
        over=False,
    )
    for decision, control in enumerate(controls, start=1):
        observation, reward, terminated, truncated, info = env.step(control)
        over = terminated or truncated
        if edits.apply(env, decision):
            observation = env.observe()
        yield ReplayStep(
            decision=decision,
            time_s=round(int(env.view.state.tick) * TICK_S, 6),
            control=control,
            observation=observation,
            view=env.view,
            events=info["events"],
            reward=float(reward),
            info=info,
            over=over,
        )
        if over and decision < len(controls):
            raise ReplayError(
                f"the route ends after {decision} decisions, the record goes on to {len(controls)}"
            )


def logged(log: EpisodeLog | None, step: ReplayStep, shown: Mapping[str, Any]) -> EpisodeLog:
    """The log of a drive with one more moment.

    Args:
        log: Of the moments before; None at the first one.
        step: The moment.
        shown: What the agent was shown then.
    """
    if log is None:
        log = EpisodeLog(step.view)
    elif step.control is not None:
        log.add_step(step.control, step.reward, step.events)
    log.hashes.add_observation(shown)
    return log


def replay_to(
    run: RunRecord, record: RouteRecord, time_s: float, *, env: RouteEnv | None = None
) -> RouteEnv:
    """The environment at a moment of a recorded route, from which it can be driven on.

    Args:
        run: The run that the record is of.
        record: The route.
        time_s: Game time; of the decisions, those that were due before it have been carried out.
        env: From `replay_env(run)`; None makes one.

    Raises:
        ReplayError: If the record ends before that moment, or cannot be replayed.
    """
    env = env or replay_env(run)
    dt_s = env.config.control_dt_s
    decisions = decisions_before(time_s, dt_s)
    if not 0 <= decisions <= record.steps:
        raise ReplayError(
            f"route {record.route_id}, seed {record.seed} was driven from 0 to "
            f"{record.steps * dt_s:g} s: there is no moment {time_s:g} s"
        )
    steps = replay(run, record, env=env)
    for _ in range(decisions + 1):
        next(steps)
    return env


def _edits(record: RouteRecord, env: RouteEnv) -> EditPlan:
    """What was done to the world, and when."""
    try:
        return EditPlan(timed_edits(record.interventions), env.config.control_dt_s)
    except EditError as error:
        raise ReplayError(f"the record's interventions cannot be read: {error}") from error


def _controls(record: RouteRecord) -> NDArray[np.float32]:
    try:
        controls = record.control_array()
    except ValueError as error:
        raise ReplayError(f"the controls cannot be read: {error}") from error
    if len(controls) != record.steps:
        raise ReplayError(f"there are {len(controls)} controls for {record.steps} decisions")
    return controls


def _reset(env: RouteEnv, record: RouteRecord) -> tuple[Any, Mapping[str, Any]]:
    """Starts the recorded episode, once it is sure that it is the recorded one."""
    job = Job(index=record.index, route_id=record.route_id, seed=record.seed)
    if job.world_seed != record.world_seed:
        raise ReplayError(
            f"seed {record.seed} of route {record.route_id} gives the world {job.world_seed}, "
            f"the record says {record.world_seed}"
        )
    if record.route_id not in env.route_ids:
        raise ReplayError(f"there is no route {record.route_id} among the run's")
    observation, info = env.reset(seed=record.world_seed, options={"route": record.route_id})
    if route_hash(env.plan) != record.route_hash:
        raise ReplayError(
            f"route {record.route_id} is not the recorded one (hash {route_hash(env.plan)}, "
            f"recorded {record.route_hash}): its file, the map or the suite have changed"
        )
    return observation, info
