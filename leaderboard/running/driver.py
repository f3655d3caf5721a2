"""An environment and a way to make the agent, ready to drive one job after another."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any

from agents.base import Agent, Requirements
from di_envs.route_env import RouteEnv
from di_envs.rules import rules_named
from leaderboard.records.record import RouteRecord
from leaderboard.running.agent_place import AgentPlace
from leaderboard.running.episode import close_agent, drive_route
from leaderboard.running.interventions import sort_interventions, texts_of
from leaderboard.running.jobs import Job, RunSpec
from leaderboard.running.timed_agent import TimedAgent
from leaderboard.running.wall_clock import Doing, Stopwatch


class Driver:
    """Drives jobs of one run. The environment is kept; the agent is made anew for each route,
    as in CARLA, so that one that hides its memory cannot carry it from route to route."""

    def __init__(
        self,
        spec: RunSpec,
        requires: Requirements | None = None,
        watch: Stopwatch | None = None,
        place: AgentPlace | None = None,
    ) -> None:
        """Makes the environment.

        Args:
            spec: The run.
            requires: What the agent requires; None makes one and asks it.
            watch: Where it is marked what is being done.
            place: Where agents are made; None for one of its own.
        """
        self.spec, self._watch = spec, watch or Stopwatch()
        self._rules = rules_named(spec.rules)
        self._place = place or AgentPlace(spec, self._watch)
        self.requires = Requirements.agreed(requires or _asked(self._place))
        self._place.agree(self.requires)
        self.env = RouteEnv(**environment_options(spec.options, self.requires))
        space: Any = self.env.observation_space
        self.interventions = sort_interventions(spec.interventions, space)
        self._shown = self.interventions.around(self.env)

    @property
    def loaded(self) -> tuple[str, ...] | None:
        """Packages that making the agent loaded; None if none was made, as it was known."""
        return self._place.loaded

    def drive(self, job: Job, moved: Callable[[], None] = lambda: None) -> RouteRecord:
        """Drives one route; never raises for what the agent does.

        Args:
            job: The route and the seed.
            moved: Called once the first decision was carried out.
        """
        self._watch.begin_job()
        self._watch.mark(Doing.SIMULATING)
        try:
            return drive_route(
                self._shown,
                lambda: TimedAgent(self._new_agent, self._watch, moved),
                job,
                self._rules,
                requires=self.requires,
                interventions=texts_of(self.spec.interventions),
            )
        finally:
            self._watch.end_job()

    def _new_agent(self) -> Agent[Any]:
        return self.interventions.agent(self.spec.agent, self._place.make)

    def __enter__(self) -> Driver:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._place.close()
        self.env.close()


def _asked(place: AgentPlace) -> Requirements:
    """What the agent requires; raises whatever making it raises."""
    agent, requires = place.asked()
    close_agent(agent)
    return requires


def environment_options(options: Mapping[str, Any], requires: Requirements) -> dict[str, Any]:
    """Environment options of a run: what the agent requires, and over it what the user says.

    Raises:
        ValueError: If the user says a preset: an agent that learned in one makes it itself, so that
            edits of what it sees find every entry under its name.
    """
    if options.get("preset") is not None:
        raise ValueError(
            "preset is for learning; an agent that learned so says it (Requirements.preset) and "
            "makes its own of what it is shown: leave preset out."
        )
    return {
        **requires.options,
        "observations": requires.observations,
        "control_dt_s": requires.control_dt_s,
        **options,
    }
