"""The arguments that say where routes are driven, shared by the commands that drive many."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from leaderboard.commands.ending import UsageError
from leaderboard.commands.scene_arguments import says

if TYPE_CHECKING:
    from leaderboard.running.workers.local_engine import Engine


@dataclass(frozen=True, kw_only=True)
class EngineArguments:
    """How many processes drive, where, and how long they may take."""

    workers: Annotated[int, says("N", "1")] = 1
    """Processes to drive in; the results are the same bits for any number."""

    engine: Annotated[Literal["local", "ray"], says("local|ray", "local")] = "local"
    """Where: on this machine, or on a Ray cluster (needs driveinsight[ray]); the same bits."""

    address: Annotated[str | None, says("ADDRESS", "a cluster of this machine alone")] = None
    """With --engine ray: a running cluster, such as `auto` or ray://head:10001."""

    step_timeout: Annotated[float, says("S", "60")] = 60.0
    """Wall-clock seconds that one decision of the agent may take."""

    setup_timeout: Annotated[float, says("S", "300")] = 300.0
    """Wall-clock seconds that making the agent, or loading the town, may take."""

    route_timeout: Annotated[float, says("S", "7200")] = 7200.0
    """Wall-clock seconds that a route may take. Who exceeds one of these is killed; the route is
    tried once more, then left out of the means: it says nothing of the driving."""

    def check_engine(self) -> None:
        """Refuses what cannot be meant, before anything slow is loaded.

        Raises:
            UsageError: If a number is too small, or an address is given in vain.
        """
        if self.workers < 1:
            raise UsageError("--workers must be at least 1")
        if self.address and self.engine != "ray":
            raise UsageError("--address is of a Ray cluster: add --engine ray")

    def connected(self) -> AbstractContextManager[object]:
        """What keeps an engine's connection over several runs: a cluster starts but once."""
        if self.engine == "local":
            return nullcontext()
        from leaderboard.running.workers.ray_engine import cluster

        return cluster(self.workers, self.address)

    def make_engine(self) -> Engine:
        """The engine that the arguments describe.

        Raises:
            UsageError: If a limit is not positive.
        """
        from leaderboard.running.wall_clock import Limits
        from leaderboard.running.workers.local_engine import LocalEngine

        try:
            limits = Limits(
                step_s=self.step_timeout, setup_s=self.setup_timeout, route_s=self.route_timeout
            )
        except ValueError as error:
            raise UsageError("--step-, --setup- and --route-timeout must be positive") from error
        if self.engine == "local":
            return LocalEngine(workers=self.workers, limits=limits)
        from leaderboard.running.workers.ray_engine import RayEngine

        return RayEngine(workers=self.workers, limits=limits, address=self.address)
