"""The command line: `driveinsight evaluate`, `drive`, `show`, `agents` and `suites`.

What is slow to import (Numba, the environments) is imported by the command that needs it, and only
after the arguments are known to be right.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro
from rich.console import Console
from rich.markup import escape

from leaderboard.drive_command import DRIVE_DESCRIPTION, Drive

if TYPE_CHECKING:
    from di_envs.suites import Suite
    from leaderboard.record import RunRecord

EXIT_CRASHED = 1
EXIT_USAGE = 2
EXIT_INTERRUPTED = 130

DESCRIPTION = """Drive agents in closed loop and score them as the CARLA Leaderboard does.

First steps:
  driveinsight agents                                     who can drive
  driveinsight suites                                     where
  driveinsight evaluate --agent expert --suite town05_tiny
  driveinsight show results/expert-town05_tiny            the table again
  driveinsight drive --agent expert --suite town05_tiny --video out.mp4"""


EVALUATE_DESCRIPTION = """Drive an agent over routes and seeds, and print the leaderboard table.

Examples:
  driveinsight evaluate --agent expert --suite town05_short
  driveinsight evaluate --agent expert --suite town05_long --seeds 3 --workers 2
  driveinsight evaluate --agent path/to/mine.py:MyAgent --suite town05_tiny --route-ids 0 3
  driveinsight evaluate --agent expert --town Town05.xodr --signals town05 \\
      --routes routes_town05_long.xml

Writes results.json (CARLA's schema) and driveinsight.json (everything) into --output."""

SHOW_DESCRIPTION = """Print the table of a run that was evaluated before.

Example:
  driveinsight show results/expert-town05_long"""


def _says(metavar: str, default: str = "") -> Any:
    """How an option's value and its default read in the help."""
    return tyro.conf.arg(metavar=metavar, help_behavior_hint=default and f"(default: {default})")


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """The arguments of `driveinsight evaluate`."""

    agent: Annotated[str, tyro.conf.arg(metavar="AGENT")]
    """A name (see `driveinsight agents`), module:Class, or path/to/file.py:Class."""

    suite: Annotated[str | None, _says("NAME")] = None
    """A shipped set of routes (see `driveinsight suites`); needless with --routes."""

    seeds: Annotated[int, _says("N", "1")] = 1
    """How many seeds to drive every route with: 3 means 0, 1 and 2."""

    workers: Annotated[int, _says("N", "1")] = 1
    """Processes to drive in; the results are the same bits for any number."""

    route_ids: Annotated[tuple[str, ...], _says("ID ...", "all")] = ()
    """Drive these routes only."""

    town: Annotated[str | None, _says("NAME|FILE", "the suite's")] = None
    """A shipped town's name or an OpenDRIVE file."""

    routes: Annotated[str | None, _says("FILE", "the suite's")] = None
    """A route file in CARLA's XML."""

    signals: Annotated[str | None, _says("NAME|FILE", "the map's")] = None
    """For maps without signals: a sidecar file, a shipped one's name, or `synthesise`."""

    traffic: Annotated[int | None, _says("N", "the suite's")] = None
    """Number of other vehicles."""

    walkers: Annotated[int | None, _says("N", "the suite's")] = None
    """Number of walkers."""

    rules: Annotated[str, _says("NAME", "carla-1.0")] = "carla-1.0"
    """Name of the scoring rules."""

    output: Annotated[Path | None, _says("DIR", "a new one in results/")] = None
    """Folder for the result files."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace results that the folder holds already."""


@dataclass(frozen=True, kw_only=True)
class Show:
    """The arguments of `driveinsight show`."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR")]
    """The run's output folder."""


@dataclass(frozen=True, kw_only=True)
class Agents:
    """List the agents that can be named."""


@dataclass(frozen=True, kw_only=True)
class Suites:
    """List the suites of routes that are shipped."""


Command = (
    Annotated[Evaluate, tyro.conf.subcommand("evaluate", description=EVALUATE_DESCRIPTION)]
    | Annotated[Drive, tyro.conf.subcommand("drive", description=DRIVE_DESCRIPTION)]
    | Annotated[Show, tyro.conf.subcommand("show", description=SHOW_DESCRIPTION)]
    | Annotated[Agents, tyro.conf.subcommand("agents")]
    | Annotated[Suites, tyro.conf.subcommand("suites")]
)


class UsageError(Exception):
    """What the user asked for cannot be done; one line that says what to do instead."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command.

    Returns:
        The exit code: 0; 1 if a simulation or a worker process died; 2 for a wrong request; 130
        if interrupted.
    """
    command: Command = tyro.cli(
        Command,
        prog="driveinsight",
        description=DESCRIPTION,
        args=arguments,
    )
    try:
        with _plain_warnings():
            return _run(command)
    except KeyboardInterrupt:
        _complain("interrupted before a route was finished: nothing was kept")
        return EXIT_INTERRUPTED
    except UsageError as error:
        _complain(str(error))
        return EXIT_USAGE


def _run(command: Command) -> int:
    match command:
        case Evaluate():
            return _evaluate(command)
        case Drive():
            return _drive(command)
        case Show():
            return _show(command)
        case Agents():
            return _list_agents()
        case Suites():
            return _list_suites()


def _complain(message: str, kind: str = "[red]error[/red]") -> None:
    line = " ".join(message.split())
    Console(stderr=True, soft_wrap=True, highlight=False).print(f"{kind}: {escape(line)}")


@contextmanager
def _plain_warnings() -> Iterator[None]:
    """Shows each warning once, as a line for people: not where in our code it came from."""
    told: set[str] = set()

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        if str(message) not in told:
            told.add(str(message))
            _complain(str(message), "[yellow]warning[/yellow]")

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


def _evaluate(command: Evaluate) -> int:
    if command.seeds < 1 or command.workers < 1:
        raise UsageError("--seeds and --workers must be at least 1")
    options, suite = _choose(command)
    folder = command.output or _new_folder(f"{_plain(command.agent)}-{_plain(suite.name)}")

    from leaderboard.results import ResultsError, prepare_folder

    try:
        prepare_folder(folder, overwrite=command.overwrite)
    except ResultsError as error:
        raise UsageError(str(error)) from error

    from leaderboard.jobs import RunSpec
    from leaderboard.runner import evaluate
    from leaderboard.warm_up import SetupError

    spec = RunSpec(agent=command.agent, options=options, rules=command.rules)
    try:
        run = evaluate(
            spec, range(command.seeds), suite=suite, folder=folder, workers=command.workers
        )
    except (SetupError, ResultsError) as error:
        raise UsageError(str(error)) from error
    finally:
        _remove_if_empty(folder)
    _print_run(run, folder)
    if not run.complete:
        return EXIT_INTERRUPTED
    return EXIT_CRASHED if run.simulation_crashed else 0


def _drive(command: Drive) -> int:
    options, _ = _choose(command)

    from leaderboard.drive import drive, record_lines
    from leaderboard.jobs import RunSpec
    from leaderboard.record import SIMULATION_CRASHED
    from leaderboard.video import VideoError, check_video
    from leaderboard.warm_up import SetupError

    spec = RunSpec(agent=command.agent, options=options, rules=command.rules)
    try:
        if command.video is not None:
            check_video(command.video)
        record = drive(
            spec,
            route_id=command.route,
            seed=command.seed,
            console=Console(stderr=True),
            video=command.video,
            camera=not command.no_camera,
        )
    except (SetupError, VideoError) as error:
        raise UsageError(str(error)) from error
    written = [] if command.video is None else [f"Written: {command.video}"]
    lines = [*record_lines(record), *written]
    Console().print(*lines, sep="\n", highlight=False, soft_wrap=True, markup=False)
    return EXIT_CRASHED if record.status == SIMULATION_CRASHED else 0


def _choose(command: Evaluate | Drive) -> tuple[dict[str, Any], Suite]:
    """The environment's options and the suite, checked as far as goes without loading a town."""
    from di_envs.config import RouteEnvConfig
    from di_envs.suites import choose_suite

    names = ("suite", "town", "routes", "signals", "traffic", "walkers", "weather", "rules")
    given = {name: getattr(command, name, None) for name in names}
    options = {name: value for name, value in given.items() if value is not None}
    if command.route_ids:
        options["route_ids"] = command.route_ids
    try:
        RouteEnvConfig.from_mapping(options)
        suite = choose_suite(
            command.suite, town=command.town, routes=command.routes, signals=command.signals
        )
        suite.specs(route_ids=command.route_ids or None)
    except (ValueError, OSError) as error:
        raise UsageError(str(error)) from error
    return options, suite


def _plain(name: str) -> str:
    """A name that can be part of a folder's: `path/to/mine.py:MyAgent` becomes `MyAgent`."""
    last = name.rpartition(":")[2]
    return "".join(c if c.isalnum() or c in "_-." else "_" for c in last)


def _new_folder(name: str) -> Path:
    """`results/NAME`, or `results/NAME-2` and so on where that is taken."""
    folder, number = Path("results") / name, 2
    while folder.exists():
        folder, number = Path("results") / f"{name}-{number}", number + 1
    return folder


def _remove_if_empty(folder: Path) -> None:
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()


def _print_run(run: RunRecord, folder: Path) -> None:
    from leaderboard.report import print_run
    from leaderboard.results import CARLA_FILE, RECORD_FILE

    console = Console()
    print_run(run, console)
    console.print(
        f"Written: {folder / CARLA_FILE} (CARLA's schema) and {folder / RECORD_FILE} (all of it).",
        f"Next: driveinsight show {folder}",
        sep="\n",
        highlight=False,
        soft_wrap=True,
        markup=False,
    )


def _show(command: Show) -> int:
    from leaderboard.report import print_run
    from leaderboard.results import ResultsError, read_run

    try:
        run = read_run(command.folder)
    except ResultsError as error:
        raise UsageError(str(error)) from error
    print_run(run, Console())
    return 0


def _list_agents() -> int:
    from leaderboard.listing import agent_table

    Console().print(
        agent_table(),
        "Your own: --agent module:Class or --agent path/to/file.py:Class (see agents/base.py).",
        "Next: driveinsight evaluate --agent expert --suite town05_tiny",
        sep="\n",
        highlight=False,
    )
    return 0


def _list_suites() -> int:
    from leaderboard.listing import suite_table

    Console().print(
        suite_table(),
        "Your own: --town FILE.xodr --routes FILE.xml (CARLA's formats).",
        "Next: driveinsight evaluate --agent expert --suite town05_short",
        sep="\n",
        highlight=False,
    )
    return 0
