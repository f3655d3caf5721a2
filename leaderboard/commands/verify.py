"""`driveinsight verify`: replays a run without its policy and says whether its claim stands."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from leaderboard.commands.ending import EXIT_REFUTED, UsageError, say, typed
from leaderboard.commands.scene_arguments import says
from leaderboard.commands.trusting import trusted_edits
from leaderboard.running.displays.work_bar import work_bar
from leaderboard.running.terminal import Terminal

if TYPE_CHECKING:
    from leaderboard.records.record import RunRecord
    from leaderboard.replaying.verify import Verdict

VERIFY_HELP = """Replay a run without its policy, and say whether its claim stands.

Every route is driven again with its recorded controls, in seconds; events, scores, trace and the
table in results.json are made anew and compared to the bit.

Examples:
  driveinsight verify results/expert-town05_long
  driveinsight verify results/expert-town05_long/results.json --workers 2
  driveinsight verify results/mine --observations          what the agent saw, too: slower

Ends with 0 if the claim stands, with 1 if it does not."""


@dataclass(frozen=True, kw_only=True)
class Verify:
    """The arguments of `driveinsight verify`."""

    path: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run's output folder, or results.json or driveinsight.json in it."""

    workers: Annotated[int, says("N", "1")] = 1
    """Threads to replay in."""

    observations: tyro.conf.FlagCreatePairsOff[bool] = False
    """Make what the agent saw again, with its sensors, and compare that too."""

    trust: tyro.conf.FlagCreatePairsOff[bool] = False
    """With --observations: run edits of what the agent saw that are not ours."""

    def run(self) -> int:
        """Verifies; returns the exit code."""
        if self.workers < 1:
            raise UsageError("--workers must be at least 1")

        from leaderboard.records.results import ResultsError, read_run, run_folder
        from leaderboard.replaying.replay import ReplayError
        from leaderboard.replaying.verify import verify_run
        from leaderboard.running.compiling import compile_progress

        console = Terminal(stderr=True)
        try:
            run_folder(self.path)
        except ResultsError as error:
            raise UsageError(str(error)) from error
        try:
            run = read_run(self.path)
            if self.observations:
                trusted_edits(run, trust=self.trust)
            bar = work_bar("replaying", "routes", console=console, transient=True)
            with compile_progress(console), bar:
                task = bar.add_task("", total=len(run.routes))
                verdict = verify_run(
                    run,
                    self.path,
                    observations=self.observations,
                    workers=self.workers,
                    on_route=lambda route: bar.advance(task),
                )
        except ResultsError as error:
            say(f"The claim does not stand: {error}")
            return EXIT_REFUTED
        except ReplayError as error:
            raise UsageError(f"{self.path} cannot be replayed here: {error}") from error
        say(*verdict_lines(verdict, run, seen=self.observations))
        say(f"Next: driveinsight show {typed(self.path)}")
        return 0 if verdict.stands else EXIT_REFUTED


def verdict_lines(verdict: Verdict, run: RunRecord, *, seen: bool) -> list[str]:
    """What was found, in lines to print: the verdict last."""
    from leaderboard.records.claim_text import claim_lines

    lines = [f"results: {problem}" for problem in verdict.problems]
    for route in verdict.routes:
        name = f"route {route.record.route_id}, seed {route.record.seed}"
        lines += [f"{name}: {problem}" for problem in route.problems]
        if route.record.lost:
            lines.append(f"{name}: {route.record.status}: not driven, it claims nothing")
    if not run.complete:
        lines.append(f"Not complete: {len(run.routes)} of {run.planned} routes x seeds.")
    if verdict.differences:
        lines.append(f"Here is {'; '.join(verdict.differences)}: bits may differ for that alone.")
    lines += claim_lines(run)
    if not run.scored:
        return [*lines, "There is no claim: no route was driven."]
    return [*lines, _conclusion(verdict, run, seen=seen)]


def _conclusion(verdict: Verdict, run: RunRecord, *, seen: bool) -> str:
    from leaderboard.scoring.score import mean_score

    driving, completion, penalty = mean_score([record.score for record in run.scored])
    claim = f"DS {driving:.2f}, RC {completion:.2f}, IS {penalty:.3f} under {run.rules}"
    count = len(run.scored)
    if verdict.stands:
        decisions = sum(record.steps for record in run.scored)
        looks = " and observations" if seen else ""
        return (
            f"The claim stands: {claim} over {count} route{'s' if count > 1 else ''}, "
            f"{decisions} decisions{looks} replayed to the bit."
        )
    wrong = sum(not route.stands for route in verdict.routes)
    what = [f"{wrong} of {count} routes"] if wrong else []
    what += ["the run's files"] if verdict.problems else []
    return f"The claim does not stand ({claim}): {' and '.join(what)} differ."
