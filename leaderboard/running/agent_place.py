"""Where the agents of a run are made: ours in the process of the world, all others in their own."""

from __future__ import annotations

from typing import Any

from agents import load_agent
from agents.base import Agent, Requirements
from agents.isolated import AgentProcess, IsolatedAgent
from agents.ownership import code_of_others
from agents.versions import loaded_packages
from leaderboard.running.episode import close_agent
from leaderboard.running.jobs import RunSpec
from leaderboard.running.wall_clock import WHERE_SIGNAL, Stopwatch


class AgentPlace:
    """Makes the agents of a run, one after another."""

    def __init__(self, spec: RunSpec, watch: Stopwatch) -> None:
        self._spec, self._watch = spec, watch
        self.loaded: tuple[str, ...] | None = None  # by the first that was asked, see `versions`
        self._process: AgentProcess | None = None
        if drives_apart(spec):
            self._process = AgentProcess(watch.place, WHERE_SIGNAL)

    def make(self) -> Agent[Any]:
        """An agent; raises whatever making it raises."""
        if self._process is None:
            return load_agent(self._spec.agent)
        self._process.start()
        self._watch.agent_process = self._process.id
        made: Any = IsolatedAgent(self._process, self._spec.agent)
        return made

    def asked(self) -> tuple[Agent[Any], Requirements]:
        """An agent, and what it requires; raises whatever making or asking it raises."""
        agent = self.make()
        try:
            requires = Requirements.agreed(agent.requires)
        except BaseException:
            close_agent(agent)
            raise
        if requires.privileged and self._process is not None:
            close_agent(agent)
            self.agree(requires)
            agent = self.make()
        self.loaded = agent.loaded() if isinstance(agent, IsolatedAgent) else loaded_packages()
        return agent, requires

    def agree(self, requires: Requirements) -> None:
        """From now on makes agents that require this: here, if they are to see the true world."""
        if requires.privileged:
            self.close()

    def close(self) -> None:
        """Ends the process, if there is one: an agent made later is made here."""
        if self._process is not None:
            self._process.stop()
            self._process, self._watch.agent_process = None, 0


def drives_apart(spec: RunSpec, requires: Requirements | None = None) -> bool:
    """Whether a run's agents drive in a process of their own.

    Args:
        spec: The run.
        requires: What its agent requires; None where that is not known yet.
    """
    sees_all = requires is not None and requires.privileged
    return spec.isolate and not sees_all and bool(code_of_others(spec.agent))
