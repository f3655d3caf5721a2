"""A training while somebody watches: shown, stopped by Ctrl-C, checked by driving on the way."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from torch import nn

from agents.training.learning import Training
from agents.training.loop import Checks, train
from agents.training.session import Session, TrainingPlan, begin, joined
from leaderboard.running.compiling import compile_progress
from leaderboard.running.displays.training import TrainingDisplay
from leaderboard.running.interruption import interruptible
from leaderboard.running.training_check import ClosedLoopCheck


@dataclass(frozen=True, kw_only=True)
class CheckPlan:
    """When a policy is checked by driving.

    Attributes:
        routes: Of the check's suite that are driven; 0 for no checks.
        every: Steps between two checks; None for a fifth of the training.
    """

    routes: int = 4
    every: int | None = None


def run_training(
    plan: TrainingPlan,
    check: CheckPlan,
    *,
    console: Console,
    on_begin: Callable[[Session], None] = lambda session: None,
    wandb: str = "",
) -> tuple[Session, bool]:
    """Trains to the last step, or until it is asked to stop.

    Args:
        plan: What is trained, on what.
        check: When it is checked.
        console: Where progress is shown.
        on_begin: Told how it begins, before the first step.
        wandb: Project of Weights & Biases that is told of it; empty for none.

    Returns:
        The session, and whether the last step was done.

    Raises:
        TrainingError: If it cannot begin or go on.
        WeightsError: If there is no policy to begin with.
        DriveFileError: If a drive is not whole.
        CheckError: If a check could not be driven.
    """
    with joined(plan) as (team, device):
        with console.status("reading drives"):
            session = begin(plan, team, device)
        on_begin(session)
        with compile_progress(console):
            session.warm_up()
        return session, _watched(session, check, wandb)


def _watched(session: Session, check: CheckPlan, wandb: str) -> bool:
    """Trains under a bar; returns whether the last step was done."""
    training, data = session.training, session.batches()
    config = training.config
    show = TrainingDisplay(done=training.step, steps=config.steps, batch=config.batch)
    with interruptible() as interruption, closing(data), show:

        def stop() -> bool:
            return interruption.requested

        with _checks(training, check, show, stop) as checks:
            return train(
                training,
                data,
                session.plan.folder,
                on_step=show.step,
                stop=stop,
                checks=checks,
                about_data=session.about_data(),
                wandb=wandb,
            )


@contextmanager
def _checks(
    training: Training, plan: CheckPlan, show: TrainingDisplay, stop: Callable[[], bool]
) -> Iterator[Checks | None]:
    """What drives with the policy; None where nobody does."""
    if not plan.routes or training.config.overfit or not training.team.first:
        yield None
        return
    with (
        TemporaryDirectory(prefix="driveinsight-") as folder,
        ClosedLoopCheck(
            training.trainee,
            Path(folder),
            plan.routes,
            lent_eyes=training.trainee.config.sensors and not training.config.rendered,
            stop=stop,
            on_route=show.route,
        ) as drives,
    ):

        def score(policy: nn.Module) -> Mapping[str, float] | None:
            found = drives(policy)
            if found is not None:
                show.checked(found["driving_score"])
            return found

        yield Checks(every=plan.every or max(training.config.steps // 5, 1), score=score)
