"""Sets a run up: its driver, and what is learnt from it before anything is driven."""

from __future__ import annotations

import hashlib
from typing import Any

from agents import AgentSpecError, load_agent
from agents.base import Agent, Requirements
from agents.versions import agent_version
from di_envs.numerics.kernels import cpu_capability
from leaderboard.records.versions import package_versions
from leaderboard.running.driver import Driver
from leaderboard.running.episode import close_agent, describe
from leaderboard.running.finished_route import route_hash
from leaderboard.running.interventions import check_interventions
from leaderboard.running.jobs import Job, RunSpec, SetupError
from leaderboard.running.messages import RunFacts
from leaderboard.running.wall_clock import Doing, Stopwatch


def set_up(spec: RunSpec, watch: Stopwatch, requires: Requirements | None = None) -> Driver:
    """The run's driver.

    Args:
        spec: The run.
        watch: Where the driver marks what it is doing.
        requires: What the agent requires, if that is known; else one is made and asked, and the
            edits are checked against it.

    Raises:
        SetupError: If the agent cannot be made, or the environment refuses its options.
    """
    watch.mark(Doing.SETTING_UP)
    if requires is not None:
        return _loaded(spec, watch, requires)
    agent, requires = made_agent(spec.agent)
    try:
        driver = _loaded(spec, watch, requires)
        watch.mark(Doing.SETTING_UP)
        check_interventions(driver.interventions, agent, spec.agent)
    except ValueError as error:
        raise SetupError(str(error)) from error
    finally:
        close_agent(agent)
    return driver


def _loaded(spec: RunSpec, watch: Stopwatch, requires: Requirements) -> Driver:
    """The driver, once its town is loaded and the first route begun."""
    watch.mark(Doing.LOADING)
    try:
        driver = Driver(spec, requires, watch)
        first = Job(index=0, route_id=driver.env.route_ids[0], seed=0)
        driver.env.reset(seed=first.world_seed, options={"route": first.route_id})
    except (ValueError, OSError, ImportError) as error:
        raise SetupError(str(error)) from error
    return driver


def made_agent(spec: str) -> tuple[Agent[Any], Requirements]:
    """The agent of that name, and what it requires.

    Raises:
        SetupError: If it cannot be made.
    """
    try:
        agent = load_agent(spec)
        try:
            return agent, agent.requires
        except BaseException:
            close_agent(agent)
            raise
    except AgentSpecError as error:
        raise SetupError(str(error)) from error
    except (Exception, SystemExit) as error:
        raise SetupError(f"agent '{spec}' cannot be made: {describe(error)}") from error


def run_facts(driver: Driver) -> RunFacts:
    """What there is to drive, and with what."""
    town, planned = driver.env.view.town, driver.env.planned
    routes = hashlib.blake2b(digest_size=16)
    for plan in driver.env.plans:
        routes.update(f"{plan.route_id}\0{route_hash(plan)}\0".encode())
    return RunFacts(
        requires=driver.requires,
        agent_version=agent_version(driver.spec.agent),
        town=town.name,
        town_hash=town.content_hash,
        route_ids=tuple(driver.env.route_ids),
        routes_hash=routes.hexdigest(),
        versions=package_versions(driver.spec.agent),
        cpu=cpu_capability(),
        refused=planned.refused,
        notes=(*planned.warnings, *planned.notes),
    )
