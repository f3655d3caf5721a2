"""Sets a run up: its driver, and what is learnt from it before anything is driven."""

from __future__ import annotations

import hashlib
from typing import Any

from agents import AgentSpecError
from agents.base import Agent, Requirements
from agents.faults import agents_code, describe
from agents.versions import agent_version
from di_envs.numerics.kernels import cpu_capability
from di_envs.suite_files import content_of, suite_of
from leaderboard.records.versions import package_versions
from leaderboard.running.agent_place import AgentPlace
from leaderboard.running.driver import Driver
from leaderboard.running.episode import close_agent
from leaderboard.running.finished_route import route_hash
from leaderboard.running.interventions import check_interventions
from leaderboard.running.jobs import Job, RunSpec, SetupError
from leaderboard.running.messages import RunFacts
from leaderboard.running.wall_clock import Doing, Stopwatch


def set_up(
    spec: RunSpec,
    watch: Stopwatch,
    requires: Requirements | None = None,
    place: AgentPlace | None = None,
) -> Driver:
    """The run's driver.

    Args:
        spec: The run.
        watch: Where the driver marks what it is doing.
        requires: What the agent requires, if that is known; else one is made and asked, and the
            edits are checked against it.
        place: Where agents are made; None for one of its own.

    Raises:
        SetupError: If the agent cannot be made, or the environment refuses its options.
    """
    watch.mark(Doing.SETTING_UP)
    place = place or AgentPlace(spec, watch)
    if requires is not None:
        return _loaded(spec, watch, requires, place)
    agent, requires = made_agent(spec.agent, place)
    try:
        driver = _loaded(spec, watch, requires, place)
        watch.mark(Doing.SETTING_UP)
        check_interventions(driver.interventions, agent, spec.agent)
    except ValueError as error:
        raise SetupError(str(error)) from error
    finally:
        close_agent(agent)
    return driver


def _loaded(spec: RunSpec, watch: Stopwatch, requires: Requirements, place: AgentPlace) -> Driver:
    """The driver, once its town is loaded and the first route begun."""
    watch.mark(Doing.LOADING)
    try:
        driver = Driver(spec, requires, watch, place)
        first = Job(index=0, route_id=driver.env.route_ids[0], seed=0)
        driver.env.reset(seed=first.world_seed, options={"route": first.route_id})
    except (ValueError, OSError, ImportError) as error:
        raise SetupError(str(error)) from error
    return driver


def made_agent(spec: str, place: AgentPlace) -> tuple[Agent[Any], Requirements]:
    """The agent of that name, and what it requires.

    Args:
        spec: Its name, for the error.
        place: Where it is made; as it is for whoever requires that.

    Raises:
        SetupError: If it cannot be made, or asks for what is not for it to choose.
    """
    try:
        with agents_code():
            return place.asked()
    except KeyboardInterrupt:
        raise
    except AgentSpecError as error:
        raise SetupError(str(error)) from error
    except BaseException as error:
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
        versions=package_versions(driver.spec.agent, driver.loaded),
        cpu=cpu_capability(),
        world=content_of(suite_of(driver.spec.options)),
        refused=planned.refused,
        notes=(*planned.warnings, *planned.notes),
    )
