"""Whether the claim of a result stands: every route replayed from its controls and scored anew.

A replay needs no policy and no sensors, so it takes seconds. It gives a record of its own; the
claim stands if the two are equal to the bit in all that does not need the policy: what happened,
when and where, the score, the trace, the hashes of rewards, events and states. What the agent saw
is compared too when asked for, with its sensors. Nobody can check without the policy that it would
give these controls; that it was driven as recorded, and earned what is claimed, can be.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from di_envs.edits.text import EditError
from di_envs.files.json_values import JsonError, read_json
from di_envs.route_env import RouteEnv
from di_envs.rules import rules_named
from leaderboard.records.carla.results import carla_results
from leaderboard.records.footing import footing_differences, footing_here, footing_of
from leaderboard.records.record import (
    AGENT_CRASHED,
    NOT_SET_UP,
    SENSORS_INVALID,
    EventRecord,
    RouteRecord,
    RunRecord,
)
from leaderboard.records.results import CARLA_FILE, RECORD_FILE, route_files, run_folder
from leaderboard.replaying.replay import ReplayError, ReplayStep, replay, replay_env, sensor_options
from leaderboard.running.finished_route import route_record
from leaderboard.running.interventions import observation_interventions, sort_interventions
from leaderboard.running.jobs import Job, plan_jobs
from leaderboard.running.log import EpisodeLog
from leaderboard.scoring.names import EVENT_NAMES
from wrappers.interventions.context import context_of

AGENT_FAULTS = frozenset({AGENT_CRASHED, NOT_SET_UP, SENSORS_INVALID})
# What a replay cannot know: the clock on the wall, and what was done to what the agent saw
_NOT_REPLAYED = frozenset({"wall_s", "interventions"})
_SEEN = frozenset({"observation_hash", "observation_checks"})
_SHOWN_PROBLEMS = 4  # of a route: the first say enough


@dataclass(frozen=True, kw_only=True)
class RouteVerdict:
    """What was found of one route.

    Attributes:
        record: The claim.
        problems: What does not hold, a sentence each; none if the claim stands.
    """

    record: RouteRecord
    problems: tuple[str, ...]

    @property
    def stands(self) -> bool:
        """Whether everything claimed was found again; a lost route claims nothing."""
        return not self.problems


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What was found of a run.

    Attributes:
        routes: Of each route, in their order.
        problems: What does not hold of the run as a whole.
        differences: In what this machine's footing is not the run's.
    """

    routes: tuple[RouteVerdict, ...]
    problems: tuple[str, ...]
    differences: tuple[str, ...]

    @property
    def stands(self) -> bool:
        """Whether the whole claim stands."""
        return not self.problems and all(verdict.stands for verdict in self.routes)


def verify_run(
    run: RunRecord,
    folder: Path,
    *,
    observations: bool = False,
    workers: int = 1,
    on_route: Callable[[RouteVerdict], None] = lambda verdict: None,
) -> Verdict:
    """Replays a run and compares.

    Args:
        run: The run, as read from `folder`.
        folder: Where CARLA's `results.json` is too.
        observations: Whether to make the agent's observations again, and compare them: slower.
        workers: Threads to replay in: the world's kernels hold no lock.
        on_route: Told of each route as it is done.

    Raises:
        ReplayError: If the run's environment cannot be made here.
    """
    env = replay_env(run, **(sensor_options(run) if observations else {}))
    problems = (
        *_plan_problems(run, env),
        *_table_problems(run, folder),
        *_spelling_problems(folder),
    )
    routes = []
    for verdict in _verdicts(run, env, workers):
        on_route(verdict)
        routes.append(verdict)
    return Verdict(
        routes=tuple(routes),
        problems=problems,
        differences=tuple(footing_differences(footing_here(), footing_of(run))),
    )


def verify_route(run: RunRecord, record: RouteRecord, env: RouteEnv) -> RouteVerdict:
    """Replays one route in `env`, and compares."""
    if record.lost:
        return RouteVerdict(record=record, problems=())
    try:
        found = replayed_record(run, record, env)
    except ReplayError as error:
        return RouteVerdict(record=record, problems=(str(error),))
    unchecked = _NOT_REPLAYED | (frozenset() if _shows_the_agents(env, run) else _SEEN)
    problems = [*_check_problems(record), *_differences(record, found, unchecked)]
    if len(problems) > _SHOWN_PROBLEMS:
        more = len(problems) - _SHOWN_PROBLEMS
        problems = [*problems[:_SHOWN_PROBLEMS], f"and {more} more"]
    return RouteVerdict(record=record, problems=tuple(problems))


def replayed_record(run: RunRecord, record: RouteRecord, env: RouteEnv) -> RouteRecord:
    """The record that the controls of a claim give.

    Raises:
        ReplayError: If they cannot be replayed, or do not end where the claim says.
    """
    log: EpisodeLog | None = None
    seen = _Seen(record if _shows_the_agents(env, run) else None, env)
    for step in replay(run, record, env=env):
        if step.control is None or log is None:
            log = EpisodeLog(step.view)
        else:
            log.add_step(step.control, step.reward, step.events)
        log.hashes.add_observation(seen.shown(step))
    assert log is not None
    fault = (record.status, record.reason) if record.status in AGENT_FAULTS else ("", "")
    if not step.over and not fault[0]:
        raise ReplayError(f"the controls end at {step.time_s:g} s, before the route does")
    if step.over and fault[0]:
        raise ReplayError(f"the route was driven to its end, yet its status is '{record.status}'")
    job = Job(index=record.index, route_id=record.route_id, seed=record.seed)
    return route_record(step.view, job, rules_named(run.rules), log, fault=fault)


class _Seen:
    """What the agent was shown: what the environment shows, edited as the record says."""

    def __init__(self, record: RouteRecord | None, env: RouteEnv) -> None:
        """Takes the record's edits; none where the environment shows less than the agent's did."""
        self._dt_s = env.config.control_dt_s
        try:
            texts = observation_interventions(record.interventions if record else ())
            edits = sort_interventions(texts, env.observation_space)
            self._editing = edits.editing(env.observation_space)
        except EditError as error:
            raise ReplayError(f"the record's interventions cannot be made here: {error}") from error
        self._memory = self._editing.start()

    def shown(self, step: ReplayStep) -> Mapping[str, Any]:
        context = context_of(step.info, self._dt_s)
        shown, self._memory = self._editing.apply(step.observation, context, self._memory)
        return shown


def _check_problems(record: RouteRecord) -> Iterator[str]:
    """What can be told of the observations' hashes without making the observations again."""
    try:
        count = len(record.check_array())
    except ValueError as error:
        yield f"observation_checks cannot be read: {error}"
        return
    if count != record.steps + 1:
        yield f"there are {count} observation_checks for {record.steps} decisions"


def _shows_the_agents(env: RouteEnv, run: RunRecord) -> bool:
    return env.config.observations == tuple(run.requires["observations"])


def _differences(
    claim: RouteRecord, found: RouteRecord, unchecked: frozenset[str]
) -> Iterator[str]:
    """What the claim has otherwise than the replay, a sentence each."""
    for field in dataclasses.fields(RouteRecord):
        if field.name in unchecked:
            continue
        claimed, replayed = getattr(claim, field.name), getattr(found, field.name)
        if claimed == replayed:
            continue
        if field.name == "events":
            yield from _event_differences(claimed, replayed)
        elif dataclasses.is_dataclass(claimed) and dataclasses.is_dataclass(replayed):
            yield from _part_differences(field.name, claimed, replayed)
        elif field.name in ("controls", "observation_checks"):
            yield f"{field.name} are packed otherwise than these numbers are"
        elif field.name == "trace":
            yield _trace_difference(claimed, replayed)
        else:
            yield f"{field.name}: claimed {claimed}, the replay gives {replayed}"


def _part_differences(name: str, claimed: Any, replayed: Any) -> Iterator[str]:
    for part in dataclasses.fields(claimed):
        one, other = getattr(claimed, part.name), getattr(replayed, part.name)
        if one != other:
            yield f"{name}.{part.name}: claimed {one}, the replay gives {other}"


def _event_differences(
    claimed: tuple[EventRecord, ...], replayed: tuple[EventRecord, ...]
) -> Iterator[str]:
    if len(claimed) != len(replayed):
        yield f"{len(claimed)} events are claimed, the replay has {len(replayed)}"
    for number, (one, other) in enumerate(zip(claimed, replayed, strict=False)):
        if one != other:
            name = f"event {number} ({EVENT_NAMES[other.kind]} at {other.time_s:g} s)"
            yield from _part_differences(name, one, other)
            return  # what follows is often only shifted


def _trace_difference(claimed: tuple[Any, ...], replayed: tuple[Any, ...]) -> str:
    for one, other in zip(claimed, replayed, strict=False):
        if one != other:
            return f"trace at {other[0]:g} s: claimed {list(one)}, the replay gives {list(other)}"
    return f"trace: {len(claimed)} rows are claimed, the replay has {len(replayed)}"


def _plan_problems(run: RunRecord, env: RouteEnv) -> Iterator[str]:
    """Routes that stand where the run planned another one."""
    jobs = plan_jobs(env.route_ids, run.seeds)
    if len(jobs) != run.planned:
        yield f"{run.planned} routes x seeds are claimed to be planned, there are {len(jobs)}"
        return
    for record in run.routes:
        job = jobs[record.index]
        if (record.route_id, record.seed) != (job.route_id, job.seed):
            yield (
                f"number {record.index} claims route {record.route_id}, seed {record.seed}; "
                f"planned there is route {job.route_id}, seed {job.seed}"
            )
        edits = observation_interventions(record.interventions)
        if edits != run.interventions and not record.lost:
            yield (
                f"route {record.route_id}, seed {record.seed} claims the edits "
                f"'{'; '.join(edits)}', the run '{'; '.join(run.interventions)}'"
            )


def _table_problems(run: RunRecord, folder: Path) -> Iterator[str]:
    """How CARLA's file differs from the one that these routes make."""
    path = run_folder(folder) / CARLA_FILE
    try:
        given = read_json(path)
    except JsonError as error:
        yield str(error)
        return
    made = json.loads(json.dumps(carla_results(run)))
    difference = _first_difference("", given, made)
    if difference:
        yield f"{path.name} does not match the routes: {difference}"


def _spelling_problems(folder: Path) -> Iterator[str]:
    """Numbers that are not spelled as they were written: a last digit can change no bit."""
    top = run_folder(folder)
    for path in (top / RECORD_FILE, top / CARLA_FILE, *route_files(top)):
        odd: list[str] = []

        def number(text: str, odd: list[str] = odd) -> float:
            if repr(float(text)) != text:
                odd.append(text)
            return float(text)

        try:
            json.loads(path.read_text(encoding="utf-8"), parse_float=number)
        except (OSError, ValueError, RecursionError):
            continue  # said where it is read
        if odd:
            yield f"{path.name} has {odd[0]}, a number that is written {float(odd[0])!r}"


def _first_difference(where: str, given: Any, made: Any) -> str:
    """Where two JSON values first differ, and how; empty if they do not."""
    if isinstance(given, dict) and isinstance(made, dict):
        for key in sorted(given.keys() | made.keys()):
            place = f"{where}.{key}".lstrip(".")
            if key not in given or key not in made:
                return f"{place} is {'missing' if key not in given else 'not ours'}"
            if difference := _first_difference(place, given[key], made[key]):
                return difference
        return ""
    if isinstance(given, list) and isinstance(made, list) and len(given) == len(made):
        pairs = enumerate(zip(given, made, strict=True))
        found = (_first_difference(f"{where}[{i}]", one, other) for i, (one, other) in pairs)
        return next(filter(None, found), "")
    return "" if given == made else f"{where} is {given!r}, the routes give {made!r}"


def _verdicts(run: RunRecord, env: RouteEnv, workers: int) -> Iterator[RouteVerdict]:
    """One verdict a route, in order, from threads that each have a twin of the environment."""
    free = SimpleQueue[RouteEnv]()
    for _ in range(workers):
        free.put(env.twin())

    def verdict(record: RouteRecord) -> RouteVerdict:
        own = free.get()
        try:
            return verify_route(run, record, own)
        finally:
            free.put(own)

    with ThreadPoolExecutor(workers) as pool:
        try:
            yield from pool.map(verdict, run.routes)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
