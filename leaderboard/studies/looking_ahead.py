"""Before a study drives: the scene of its runs, and which rows make no sense for its agent."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

from gymnasium import spaces

from agents import load_agent
from agents.base import Agent
from di_envs.edits.text import EditError
from leaderboard.running.episode import close_agent
from leaderboard.running.interventions import check_interventions, sort_interventions
from leaderboard.running.jobs import RunSpec
from leaderboard.running.messages import Scene
from leaderboard.running.setting_up import scene_of, set_up
from leaderboard.running.wall_clock import Stopwatch
from leaderboard.studies.rows import COMPONENTS, NULL_ROW, ODOMETRY, Row
from wrappers.interventions.edit import ObservationEdit
from wrappers.interventions.layout import SHORT_NAMES


def look_ahead(spec: RunSpec, rows: Sequence[Row]) -> tuple[Scene, dict[str, str]]:
    """What there is to drive, and by row why it makes no sense for this agent."""
    driver = set_up(spec, Stopwatch())
    agent = load_agent(spec.agent)
    with driver, ExitStack() as closing:
        closing.callback(close_agent, agent)
        reads, reasons = _read_components(agent), {}
        space: Any = driver.env.observation_space
        for row in rows:
            try:
                reasons[row.name] = _unread(row.edits, reads, space)
                if reasons[row.name]:
                    continue
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", UserWarning)  # one is enough: the null row's
                    check_interventions(sort_interventions(row.edits, space), agent, spec.agent)
            except EditError as error:
                reasons[row.name] = str(error)
        check_interventions(sort_interventions(NULL_ROW.edits, space), agent, spec.agent)
        return scene_of(driver), reasons


def _read_components(agent: Agent[Any]) -> frozenset[str] | None:
    """The components that an agent's policy reads, if it says so; None if it does not."""
    offered = getattr(agent, "explainable", None)
    return None if offered is None else frozenset(offered().anatomy.groups)


def _unread(
    edits: Sequence[ObservationEdit], reads: frozenset[str] | None, space: spaces.Space[Any]
) -> str:
    """Why edits cannot change what the agent does; empty if they may."""
    for edit in edits:
        for target in edit.targets:
            name = SHORT_NAMES.get(target, target)
            if name == ODOMETRY and isinstance(space, spaces.Dict) and name not in space.spaces:
                return "the agent sees no odometry"
            if reads is not None and name in COMPONENTS and name not in reads:
                return f"the policy does not read {name}"
    return ""
