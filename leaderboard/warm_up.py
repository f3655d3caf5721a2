"""Compiles the kernels before any worker starts, and tells the user when that takes time.

The first run of a version on a kind of CPU compiles for a minute; later ones load machine code from
the cache and show nothing. One short drive of the run's own first job touches every kernel that it
will need.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba.core import event as numba_event
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from agents import AgentSpecError
from agents.base import Requirements
from di_envs.kernels import kernel_sources
from leaderboard.bound import light_limited_bound
from leaderboard.driver import Driver, agent_requirements
from leaderboard.episode import describe, extra_keys
from leaderboard.jobs import Job, RunSpec

WARM_UP_STEPS = 3


@dataclass(frozen=True, kw_only=True)
class Scene:
    """What the parent learns of a run before it starts."""

    requires: Requirements
    town: str
    town_hash: str
    route_ids: tuple[str, ...]


class SetupError(Exception):
    """The run cannot start: the agent, the town or an option is wrong; says what to do."""


def warm_up(spec: RunSpec, console: Console) -> Scene:
    """Drives the first steps of a route, so that every kernel is compiled and cached.

    What the agent does wrong while driving is not reported: it will do it where it counts.

    Raises:
        SetupError: If the agent cannot be made, or the environment refuses its options.
    """
    with compile_progress(console), _driver(spec) as driver:
        try:
            route_ids = tuple(driver.env.route_ids)
            _drive_a_little(driver, Job(index=0, route_id=route_ids[0], seed=0))
        except (ValueError, OSError) as error:
            raise SetupError(str(error)) from error
        town = driver.env.view.town
        return Scene(
            requires=driver.requires,
            town=town.name,
            town_hash=town.content_hash,
            route_ids=route_ids,
        )


def _driver(spec: RunSpec) -> Driver:
    """The run's driver, with all that can be wrong in its specification as a `SetupError`."""
    try:
        requires = agent_requirements(spec.agent)
    except AgentSpecError as error:
        raise SetupError(str(error)) from error
    except (Exception, SystemExit) as error:
        raise SetupError(f"agent '{spec.agent}' cannot be made: {describe(error)}") from error
    try:
        return Driver(spec, requires)
    except (ValueError, OSError, ImportError) as error:
        raise SetupError(str(error)) from error


def _drive_a_little(driver: Driver, job: Job) -> None:
    """Lets the agent decide once, then holds the brake: these steps run every kernel."""
    observation, _ = driver.env.reset(seed=job.world_seed, options={"route": job.route_id})
    view = driver.env.view
    with suppress(Exception, SystemExit):
        agent = driver.new_agent()
        memory = agent.start(view.plans[view.ego], job.world_seed)
        agent.act({**observation, **extra_keys(agent.requires, view)}, memory)
        agent.close()
    for _ in range(WARM_UP_STEPS):
        driver.env.step(np.array([0.0, 0.0, 1.0], dtype=np.float32))
    light_limited_bound(view.town, view.plans[view.ego], job.world_seed)


@contextmanager
def compile_progress(console: Console) -> Iterator[None]:
    """Shows a bar once a kernel is compiled within; nothing if all come from the cache."""
    listener = _CompileListener(console)
    with numba_event.install_listener("numba:compile", listener):
        try:
            yield
        finally:
            listener.finish()


class _CompileListener(numba_event.Listener):
    """Turns Numba's compile events into a progress bar."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._progress: Progress | None = None
        self._task: Any = None

    def on_start(self, event: Any) -> None:
        if self._progress is None:
            self._console.print("Compiling kernels, once for this version and CPU (a minute or so)")
            self._progress = Progress(
                TextColumn("  compiling"),
                BarColumn(),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
                TextColumn("{task.description}"),
                console=self._console,
            )
            self._task = self._progress.add_task("", total=_kernel_count())
            self._progress.start()
        self._progress.update(self._task, description=event.data["dispatcher"].py_func.__name__)

    def on_end(self, event: Any) -> None:
        if self._progress is not None:
            self._progress.advance(self._task)

    def finish(self) -> None:
        """Ends the bar, full: kernels that this run does not need are not compiled."""
        if self._progress is not None:
            self._progress.update(self._task, description="done", completed=_kernel_count())
            self._progress.stop()


def _kernel_count() -> int:
    texts = (path.read_text(encoding="utf-8") for path in kernel_sources())
    return sum(len(re.findall(r"^@kernel", text, flags=re.MULTILINE)) for text in texts)
