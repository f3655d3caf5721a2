"""An agent whose every call is marked on a stopwatch, so that one that hangs can be found out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from agents.base import Agent, Control, Observation, Requirements
from di_envs.town.plan import RoutePlan
from leaderboard.running.wall_clock import Doing, Stopwatch


class TimedAgent:
    """An agent; between its calls the simulation is what takes time.

    Args:
        new_agent: Makes the agent.
        watch: Where its calls are marked.
        moved: Called once the first decision was carried out.
    """

    requires: Requirements

    def __init__(
        self, new_agent: Callable[[], Agent[Any]], watch: Stopwatch, moved: Callable[[], None]
    ) -> None:
        self._watch, self._moved, self._acts = watch, moved, 0
        watch.mark(Doing.SETTING_UP)
        self._agent = new_agent()

    def __getattr__(self, name: str) -> Any:
        """What the agent has beside its calls, found out no sooner than somebody asks."""
        return getattr(self._agent, name)

    def start(self, plan: RoutePlan, seed: int) -> Any:
        """The agent's memory at the start."""
        memory = self._agent.start(plan, seed)
        self._watch.mark(Doing.SIMULATING)
        return memory

    def act(self, observation: Observation, memory: Any) -> tuple[Control, Any]:
        """The agent's decision."""
        if self._acts == 1:
            self._moved()
        self._acts += 1
        self._watch.mark(Doing.STEPPING)
        decision = self._agent.act(observation, memory)
        self._watch.mark(Doing.SIMULATING)
        return decision

    def close(self) -> None:
        """Closes the agent."""
        self._watch.mark(Doing.CLOSING)
        self._agent.close()
        self._watch.mark(Doing.SIMULATING)
