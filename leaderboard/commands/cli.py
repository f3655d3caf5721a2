"""The command line: which commands `driveinsight` has, and how each of them ends.

What is slow to import (Numba, the environments) is imported by the command that needs it, and only
after the arguments are known to be right.
"""

from __future__ import annotations

import dataclasses
import functools
import operator
import sys
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated, Any, get_args

import tyro

from leaderboard.commands.ablate import ABLATE_HELP, Ablate
from leaderboard.commands.branch import BRANCH_HELP, Branch
from leaderboard.commands.collect import COLLECT_HELP, Collect
from leaderboard.commands.compare import COMPARE_HELP, Compare
from leaderboard.commands.doctor import DOCTOR_HELP, Doctor
from leaderboard.commands.drive import DRIVE_HELP, Drive
from leaderboard.commands.edit import EDIT_HELP, Edit
from leaderboard.commands.ending import (
    EXIT_INTERRUPTED,
    EXIT_PIPE,
    EXIT_USAGE,
    UsageError,
    complain,
    leave_pipes,
    say_what_can_be_said,
)
from leaderboard.commands.evaluate import EVALUATE_HELP, Evaluate
from leaderboard.commands.explain import EXPLAIN_HELP, Explain
from leaderboard.commands.export import EXPORT_HELP, Export
from leaderboard.commands.export_agent import EXPORT_AGENT_HELP, ExportAgent
from leaderboard.commands.lists import Agents, Suites
from leaderboard.commands.play import PLAY_HELP, Play
from leaderboard.commands.report import REPORT_HELP, Report
from leaderboard.commands.respond import RESPOND_HELP, Respond
from leaderboard.commands.score import SCORE_HELP, ScoreByRules
from leaderboard.commands.show import SHOW_HELP, Show
from leaderboard.commands.train import TRAIN_HELP, Train
from leaderboard.commands.verify import VERIFY_HELP, Verify
from leaderboard.commands.warm_up import WARM_UP_HELP, WarmUp
from leaderboard.commands.watch import WATCH_HELP, Watch

HELP = """Drive agents in closed loop and score them as the CARLA Leaderboard does.

First steps:
  driveinsight agents                                     who can drive
  driveinsight suites                                     where
  driveinsight evaluate --agent expert --suite town05_tiny
  driveinsight show results/expert-town05_tiny            the table again
  driveinsight report results/expert-town05_tiny          a page with a replay of each route
  driveinsight explain results/expert-town05_tiny --route 0   why it drove one so, and what if
  driveinsight verify results/expert-town05_tiny          does the claim stand?
  driveinsight drive --agent expert --suite town05_tiny --video out.mp4
  driveinsight watch results/expert-town05_tiny           a drive once more, in a window
  driveinsight play --suite town05_tiny                   drive yourself, and be scored
  driveinsight collect                                    data to train a policy of your own
  driveinsight warm-up                                    compile now what first runs wait for
  driveinsight doctor                                     is all there? what to do if not"""

Command = (
    Annotated[Evaluate, tyro.conf.subcommand("evaluate", description=EVALUATE_HELP)]
    | Annotated[Drive, tyro.conf.subcommand("drive", description=DRIVE_HELP)]
    | Annotated[Play, tyro.conf.subcommand("play", description=PLAY_HELP)]
    | Annotated[Watch, tyro.conf.subcommand("watch", description=WATCH_HELP)]
    | Annotated[Show, tyro.conf.subcommand("show", description=SHOW_HELP)]
    | Annotated[Report, tyro.conf.subcommand("report", description=REPORT_HELP)]
    | Annotated[Verify, tyro.conf.subcommand("verify", description=VERIFY_HELP)]
    | Annotated[ScoreByRules, tyro.conf.subcommand("score", description=SCORE_HELP)]
    | Annotated[Compare, tyro.conf.subcommand("compare", description=COMPARE_HELP)]
    | Annotated[Branch, tyro.conf.subcommand("branch", description=BRANCH_HELP)]
    | Annotated[Ablate, tyro.conf.subcommand("ablate", description=ABLATE_HELP)]
    | Annotated[Respond, tyro.conf.subcommand("respond", description=RESPOND_HELP)]
    | Annotated[Explain, tyro.conf.subcommand("explain", description=EXPLAIN_HELP)]
    | Annotated[Edit, tyro.conf.subcommand("edit", description=EDIT_HELP)]
    | Annotated[Collect, tyro.conf.subcommand("collect", description=COLLECT_HELP)]
    | Annotated[Train, tyro.conf.subcommand("train", description=TRAIN_HELP)]
    | Annotated[Export, tyro.conf.subcommand("export", description=EXPORT_HELP)]
    | Annotated[ExportAgent, tyro.conf.subcommand("export-agent", description=EXPORT_AGENT_HELP)]
    | Annotated[Agents, tyro.conf.subcommand("agents")]
    | Annotated[Suites, tyro.conf.subcommand("suites")]
    | Annotated[WarmUp, tyro.conf.subcommand("warm-up", description=WARM_UP_HELP)]
    | Annotated[Doctor, tyro.conf.subcommand("doctor", description=DOCTOR_HELP)]
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command.

    Returns:
        The exit code: 0; 1 if a simulation or a worker process died, or a claim does not stand; 2
        for a wrong request; 130 if interrupted; 141 if nobody reads what it prints any more.
    """
    say_what_can_be_said()
    try:
        code = _run(sys.argv[1:] if arguments is None else arguments)
        sys.stdout.flush()
    except BrokenPipeError:
        leave_pipes()
        return EXIT_PIPE
    except SystemExit as ending:
        if isinstance(ending.__context__, BrokenPipeError):  # rich makes one of it
            leave_pipes()
            return EXIT_PIPE
        raise
    return code


def _run(given: Sequence[str]) -> int:
    """One command, and its exit code."""
    if wrong := _empty(given) or _twice(given):
        complain(wrong)
        return EXIT_USAGE
    commands: Any = Command if given and not given[0].startswith("-") else _briefly(Command)
    command: Command = tyro.cli(commands, prog="driveinsight", description=HELP, args=given)
    try:
        with _plain_warnings():
            return command.run()
    except KeyboardInterrupt:
        complain("interrupted before anything was driven")
        return EXIT_INTERRUPTED
    except UsageError as error:
        complain(str(error))
        return EXIT_USAGE


def _empty(given: Sequence[str]) -> str:
    """What to say of an empty argument, which as a path would be the current folder."""
    for place, argument in enumerate(given):
        option = argument.removesuffix("=") if argument.startswith("--") else given[place - 1]
        if argument == "" or (argument.startswith("--") and argument.endswith("=")):
            after = f" after {option}" if option.startswith("-") else ""
            return (
                f"an argument{after} is empty, as of a shell variable that is not set: give a value"
                ", or leave it out"
            )
    return ""


def _twice(given: Sequence[str]) -> str:
    """What to say of an option that is given twice, of which the last alone would count."""
    options = [argument.partition("=")[0] for argument in given if argument.startswith("--")]
    for option, times in Counter(name.replace("_", "-") for name in options).items():
        if times > 1:
            several = ', such as "drop:obstacles; drop:bev"' if option == "--intervene" else ""
            return f"{option} is given {times} times: give it once, with all of it{several}"
    return ""


def _briefly(commands: Any) -> Any:
    """The commands with a line of help each, for the list of them all."""
    brief = []
    for command in get_args(commands):
        kind, described = get_args(command)
        first = (described.description or kind.__doc__ or "").partition("\n")[0]
        brief.append(Annotated[kind, dataclasses.replace(described, description=first)])
    return functools.reduce(operator.or_, brief)


@contextmanager
def _plain_warnings() -> Iterator[None]:
    """Shows each warning once, as a line for people: not where in our code it came from."""
    told: set[str] = set()

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        if str(message) not in told:
            told.add(str(message))
            for line in str(message).splitlines():
                complain(line, "warning", "yellow")

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield
