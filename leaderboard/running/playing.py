"""A person drives, in this process as a window wants it, by the path that `evaluate` goes.

Only where agents are made differs: the seat hands each the screen. Jobs, records, files and scores
are the runner's, so such a run is shown, replayed and verified as any other.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator
from typing import Any

from rich.console import Console

from agents import load_agent
from agents.base import Agent
from agents.constant import ConstantAgent
from agents.human.agent import HumanAgent
from di_envs.course import load_course
from di_envs.drawing.screen import Screen
from leaderboard.running.agent_place import AgentPlace
from leaderboard.running.compiling import compile_progress
from leaderboard.running.jobs import Job, RunSpec, SetupError
from leaderboard.running.messages import Driven, EngineEvent, Ready, Started
from leaderboard.running.setting_up import run_facts, set_up
from leaderboard.running.wall_clock import Stopwatch
from leaderboard.running.warm_up import warm_up


class Seat(AgentPlace):
    """Where a person sits: hands each agent the screen, and the word of Ctrl-C."""

    def __init__(self, spec: RunSpec, watch: Stopwatch, stopped: Callable[[], bool]) -> None:
        super().__init__(spec, watch)
        self._agent, self._stopped = spec.agent, stopped
        self.screen: Screen | None = None

    def make(self) -> Agent[Any]:
        """The person, before the screen."""
        return load_agent(self._agent, screen=self.screen, stopped=self._stopped)


class PlayEngine:
    """Drives jobs one after another in a window; see `Engine`."""

    def __init__(
        self, spec: RunSpec, console: Console, stopped: Callable[[], bool] = lambda: False
    ) -> None:
        """Sets the run up, compiles what it needs, and opens the window.

        Args:
            spec: The run; its agent is of the scheme `human`.
            console: Where it is said what is compiled.
            stopped: Whether Ctrl-C was pressed.

        Raises:
            SetupError: If there is no display, no gamepad, or an option is wrong.
        """
        seat = Seat(spec, Stopwatch(), stopped)
        self._driver = set_up(spec, Stopwatch(), HumanAgent.requires, seat)
        env = self._driver.env
        try:
            seat.screen = Screen(load_course(env.config.changes()), "human", camera=True)
        except RuntimeError as error:
            self._driver.env.close()
            raise SetupError(str(error)) from error
        self.screen = seat.screen
        if spec.agent.endswith("gamepad") and not self._has_pad():
            self.close()
            raise SetupError(
                "there is no gamepad that SDL knows: plug one in, or leave out --gamepad and drive "
                "by the keyboard"
            )
        job = Job(index=0, route_id=env.route_ids[0], seed=0)
        with compile_progress(console):
            warm_up(env, ConstantAgent(), job)
            self.screen.draw(env.view, env.view.ego, {})

    def run(self, spec: RunSpec, jobs: deque[Job]) -> Generator[EngineEvent]:
        """See `Engine.run`."""
        yield Ready(scene=run_facts(self._driver))
        while jobs:
            job = jobs.popleft()
            yield Started(job=job)
            yield Driven(job=job, record=self._driver.drive(job))

    def close(self) -> None:
        """Closes the window and the environment."""
        self.screen.close()
        self._driver.env.close()

    def _has_pad(self) -> bool:
        window = self.screen.window
        return window is not None and window.pad() is not None
