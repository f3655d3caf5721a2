"""The arguments that say who drives where, shared by the commands that drive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from leaderboard.commands.ending import UsageError
from leaderboard.commands.trusting import check_model

if TYPE_CHECKING:
    from di_envs.suites import Suite
    from wrappers.interventions.edit import ObservationEdit

# Those below that are options of the environment; the agent is not
_OPTIONS = (
    *("suite", "town", "routes", "signals", "scenarios"),
    *("traffic", "walkers", "weather", "rules", "strict"),
)


def says(metavar: str, default: str = "") -> Any:
    """How an option's value and its default read in the help."""
    return tyro.conf.arg(metavar=metavar, help_behavior_hint=default and f"(default: {default})")


@dataclass(frozen=True, kw_only=True)
class SceneArguments:
    """Who drives where, among whom and by which rules."""

    agent: Annotated[str, tyro.conf.arg(metavar="AGENT")]
    """A name or a scheme (see `driveinsight agents`), module:Class, or path/to/file.py:Class."""

    suite: Annotated[str | None, says("NAME")] = None
    """A shipped set of routes (see `driveinsight suites`); needless with --routes."""

    town: Annotated[str | None, says("NAME|FILE", "the suite's")] = None
    """A shipped town's name or an OpenDRIVE file."""

    routes: Annotated[str | None, says("FILE", "the suite's")] = None
    """A route file in CARLA's XML."""

    signals: Annotated[str | None, says("NAME|FILE", "the map's")] = None
    """For maps without signals: a sidecar file, a shipped one's name, or `synthesise`."""

    scenarios: Annotated[str | None, says("NAME|FILE|DIR|none", "the suite's")] = None
    """CARLA trigger files, in place of scenarios in the route file; `none` drives without."""

    traffic: Annotated[int | None, says("N", "the suite's, or by lane length")] = None
    """Number of other vehicles."""

    walkers: Annotated[int | None, says("N", "the suite's, or by lane length")] = None
    """Number of walkers."""

    weather: Annotated[str | None, says("NAME", "the route file's or suite's")] = None
    """One of CARLA's presets, such as HardRainNoon; seen by cameras."""

    strict: tyro.conf.FlagCreatePairsOff[bool] = False
    """Refuse a route file of which one route cannot be planned, rather than that route."""

    rules: Annotated[str, says("NAME", "carla-1.0")] = "carla-1.0"
    """Name of the scoring rules."""

    intervene: Annotated[str, says("EDITS", "none")] = ""
    """Edits of what the agent sees, joined by `;`, such as "drop:routing; set:speed=0@t>5"."""

    no_isolate: tyro.conf.FlagCreatePairsOff[bool] = False
    """Drive an agent that is not ours in the world's own process. It can reach the true world
    there, and the results say so."""

    trust: tyro.conf.FlagCreatePairsOff[bool] = False
    """Load an agent's file that holds pickles (sb3:), which runs the code in them."""

    def edits(self) -> tuple[ObservationEdit, ...]:
        """What is edited of what the agent sees.

        Raises:
            UsageError: If one cannot be read.
        """
        if not self.intervene.strip():
            return ()
        from di_envs.edits.text import EditError
        from leaderboard.running.interventions import read_interventions

        try:
            return read_interventions(self.intervene)
        except EditError as error:
            raise UsageError(f"--intervene: {error}") from error

    def choose(self, route_ids: tuple[str, ...] = ()) -> tuple[dict[str, Any], Suite]:
        """The environment's options and the suite, checked as far as goes without its town.

        Args:
            route_ids: Drive these alone; all when empty.

        Raises:
            UsageError: If an option is wrong, with what to do.
        """
        from di_envs.config import RouteEnvConfig
        from di_envs.suites import choose_suite

        check_model(self.agent, trust=self.trust)

        given = {name: getattr(self, name) for name in _OPTIONS}
        options = {n: value for n, value in given.items() if not (value is None or value is False)}
        if route_ids:
            options["route_ids"] = route_ids
        try:
            RouteEnvConfig.from_mapping(options)
            suite = choose_suite(
                self.suite,
                town=self.town,
                routes=self.routes,
                signals=self.signals,
                scenarios=self.scenarios,
            )
            suite.specs(suite.town_path.stem, route_ids or None)
        except (ValueError, OSError) as error:
            raise UsageError(str(error)) from error
        return options, suite
