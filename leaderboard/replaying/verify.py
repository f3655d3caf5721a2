"""Whether the claim of a result stands: every route replayed from its controls and scored anew.

A replay needs no policy and no sensors, so it takes seconds. It gives a record of its own; the
claim stands if the two are equal to the bit in all that does not need the policy: what happened,
when and where, the score, the trace, the hashes of rewards, events and states. What the agent saw
is compared too when asked for, with its sensors. The world is looked up in the files that it is
made of, and in no cache; of a shipped suite in what is shipped here. Nobody can check without the
policy that it would give these controls; that it was driven as recorded, and earned what is
claimed, can be.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

from di_envs.edits.text import EditError
from di_envs.route_env import RouteEnv
from di_envs.rules import rules_named
from di_envs.suite_files import found_beside
from leaderboard.records.footing import footing_differences, footing_here, footing_of
from leaderboard.records.record import (
    AGENT_CRASHED,
    NOT_SET_UP,
    SENSORS_INVALID,
    RouteRecord,
    RunRecord,
)
from leaderboard.records.results import run_folder
from leaderboard.replaying.claim_differences import claim_differences
from leaderboard.replaying.file_problems import spelling_problems, table_problems
from leaderboard.replaying.recorded_agent import run_eyes
from leaderboard.replaying.recorded_edits import seen_texts
from leaderboard.replaying.replay import ReplayError, logged, replay, replay_env, sensor_options
from leaderboard.replaying.world_problems import world_problems
from leaderboard.running.finished_route import route_record, shown_weather
from leaderboard.running.jobs import Job, plan_jobs
from leaderboard.running.log import EpisodeLog
from wrappers.interventions.context import context_of
from wrappers.interventions.eyes import Eyes

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
    run = dataclasses.replace(run, options=found_beside(run.options, run_folder(folder)))
    sensors = sensor_options(run) if observations else {}
    env = replay_env(run, cached=False, **sensors)  # a cache may have been written by anybody
    problems = (
        *world_problems(run),
        *_plan_problems(run, env),
        *table_problems(run, folder),
        *spelling_problems(folder),
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
    problems = [*_check_problems(record), *claim_differences(record, found, unchecked)]
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
    eyes = run_eyes(run, record, env) if _shows_the_agents(env, run) else Eyes.of(())
    for step in replay(run, record, env=env):
        context = context_of(step.info, env.config.control_dt_s)
        shown, eyes = eyes.look(step.observation, context)
        log = logged(log, step, shown)
    assert log is not None
    fault = (record.status, record.reason) if record.status in AGENT_FAULTS else ("", "")
    if not step.over and not fault[0]:
        raise ReplayError(f"the controls end at {step.time_s:g} s, before the route does")
    if step.over and fault[0]:
        raise ReplayError(f"the route was driven to its end, yet its status is '{record.status}'")
    job = Job(index=record.index, route_id=record.route_id, seed=record.seed)
    return route_record(
        step.view, job, rules_named(run.rules), log, fault=fault, weather=shown_weather(env)
    )


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
        try:
            edits = seen_texts(record.interventions)
        except EditError as error:
            yield f"route {record.route_id}, seed {record.seed}: {error}"
            continue
        if edits != run.interventions and not record.lost:
            yield (
                f"route {record.route_id}, seed {record.seed} claims the edits "
                f"'{'; '.join(edits)}', the run '{'; '.join(run.interventions)}'"
            )


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
