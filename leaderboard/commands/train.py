"""`driveinsight train`: trains a policy on collected drives, or does all that a recipe says.

Either goes on where it was stopped.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from leaderboard.commands.ending import EXIT_INTERRUPTED, UsageError, say, typed
from leaderboard.commands.recipe import run_recipe_file
from leaderboard.commands.scene_arguments import says
from leaderboard.running.terminal import Terminal

if TYPE_CHECKING:
    from agents.training.session import Session, TrainingPlan

TRAIN_HELP = """Train a policy on what `driveinsight collect` kept, or from nothing by a recipe.

Examples:
  driveinsight train --recipe recipes/tiny.toml                      from nothing, in ten minutes
  driveinsight train --recipe recipes/driveinsight.toml --list       its stages, and how they stand
  driveinsight train --config tiny --steps 1500 --check-routes 2     a first try, in minutes
  driveinsight train --config driveinsight --data data --output runs/driveinsight
  driveinsight train --plan-only --batch 128 --steps 20000           the planner alone, first
  driveinsight train --init-from runs/plan/policy --planner-rate 0.3
  driveinsight train --overfit 1 --steps 300                         can it learn at all?
  torchrun --nproc-per-node 4 -m leaderboard train                   four processes, or GPUs

A recipe names stages: collecting, training, rounds of corrections. Each has a folder in --output;
cut off anywhere, the same command goes on.

Without one, pictures are rendered while it trains, each sample in a weather of its own. Into
--output go a checkpoint every two minutes, log.csv, curve.png, checks.csv with the driving scores
of routes that it drives on the way, and in policy/ the weights that drove best. After Ctrl-C or a
crash the same command goes on, and comes to the same bits (on a CPU)."""


# What can be said beside a recipe
_OF_RECIPES = ("recipe", "stage", "minutes", "listed", "output", "workers", "device")


@dataclass(frozen=True, kw_only=True)
class Train:
    """The arguments of `driveinsight train`."""

    recipe: Annotated[Path | None, says("FILE", "none")] = None
    """A file that names all stages from nothing to the weights; beside it only --output, --stage,
    --minutes, --list, --workers and --device can be said."""

    stage: Annotated[str | None, says("NAME", "all stages")] = None
    """With --recipe: the stage to come to, with all that it is made of; two calls may do two stages
    side by side where neither needs the other."""

    minutes: Annotated[float | None, says("N", "until it is done")] = None
    """With --recipe: stop after so long as after Ctrl-C, and go on with the next call."""

    listed: Annotated[bool, tyro.conf.arg(name="list")] = False
    """With --recipe: do nothing, show its stages, which are done, what they took."""

    config: Annotated[str, says("NAME", "driveinsight")] = "driveinsight"
    """Configuration of the policy: driveinsight, driveinsight-told, tiny, paper, …; or a system of
    the zoo, such as ego-only."""

    plan_only: bool = False
    """Train the planner alone, by what truly is in sight instead of pictures: hundreds of samples a
    second. What sees stays as it is, and checks are driven with lent eyes (`true-sight`)."""

    cache: Annotated[Path, says("DIR", "cache")] = Path("cache")
    """Where moments are kept encoded: 5 kB each, at most 100,000 of them."""

    data: Annotated[tuple[Path, ...], says("DIR ...", "data")] = (Path("data"),)
    """Folders of drives: the expert's, and corrections of learners' (`collect --driver`)."""

    output: Annotated[Path | None, says("DIR", "runs/CONFIG, or runs/RECIPE")] = None
    """Folder for all that is written."""

    steps: Annotated[int, says("N", "4000")] = 4000
    """Updates of the weights."""

    batch: Annotated[int, says("N", "16")] = 16
    """Samples a step."""

    learning_rate: Annotated[float, says("X", "0.001")] = 1e-3
    """At its highest; after a warm-up it falls to 0 along a cosine."""

    planner_rate: Annotated[float, says("X", "1")] = 1.0
    """What the prompt's encoders and the planner learn at, as a share of it: less than 1 keeps
    more of what they took from --init-from."""

    workers: Annotated[int | None, says("N", "cores - 1")] = None
    """Processes that render samples; 0 renders between steps. The bits are the same. With torchrun:
    of each of its processes. With --recipe: processes that drive or render (2 by default)."""

    threads: Annotated[int, says("N", "1")] = 1
    """Threads of torch on a CPU; another number gives other bits."""

    init_from: Annotated[Path | None, says("POLICY", "fresh weights")] = None
    """Begin with those tensors of another policy that have the same names and shapes."""

    held_out: Annotated[float, says("SHARE", "0.05")] = 0.05
    """Of the drives, kept out of training: their waypoint loss is in the log each 200 steps."""

    overfit: Annotated[int, says("N", "0")] = 0
    """Learn so many moments by heart, unvaried: the loss must fall to nearly nothing."""

    check_every: Annotated[int | None, says("STEPS", "a fifth of them")] = None
    """Steps between closed-loop checks."""

    check_routes: Annotated[int, says("N", "4")] = 4
    """Routes of town05_tiny that a check drives; 0 for no checks: the last weights are kept."""

    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Of fresh weights and of all that is drawn."""

    device: Annotated[Literal["auto", "cpu", "cuda"], says("auto|cpu|cuda", "auto")] = "auto"
    """Where to train; auto takes a GPU if there is one."""

    precision: Annotated[
        Literal["auto", "float32", "bfloat16"], says("auto|float32|bfloat16", "auto")
    ] = "auto"
    """Of products and convolutions; auto takes bfloat16 where the hardware has it built in."""

    wandb: Annotated[str | None, says("PROJECT", "none")] = None
    """Project of Weights & Biases that is told what the log is (extra wandb). TensorBoard, where it
    is installed, finds the same in --output."""

    def run(self) -> int:
        """Trains; returns the exit code."""
        try:
            import torch  # noqa: F401
        except ImportError as error:
            raise UsageError(
                f"training needs torch: pip install 'driveinsight[policy]' ({error})"
            ) from error
        if self.recipe is not None:
            self._check_alone()
            return run_recipe_file(
                self.recipe,
                self.output or Path("runs") / self.recipe.stem,
                goal=self.stage,
                minutes=self.minutes,
                listed=self.listed,
                workers=self.workers,
                device=self.device,
            )
        if self.stage is not None or self.minutes is not None or self.listed:
            raise UsageError("--stage, --minutes and --list are of a recipe: add --recipe FILE")
        self._check_numbers()

        from agents.driveinsight.weights import WeightsError
        from agents.training.config import TrainingError
        from agents.training.frames import DriveFileError
        from leaderboard.running.interruption import interruptible
        from leaderboard.running.training import CheckPlan, run_training
        from leaderboard.running.training_check import CheckError

        check = CheckPlan(routes=self.check_routes, every=self.check_every)
        console = Terminal(stderr=True)
        try:
            with interruptible(ends_process=True):
                session, done = run_training(
                    self._plan(),
                    check,
                    console=console,
                    on_begin=_tell_beginning,
                    wandb=self.wandb or "",
                )
        except (TrainingError, DriveFileError, WeightsError, CheckError, OSError) as error:
            raise UsageError(str(error)) from error
        if session.training.team.first:
            (_tell_trained if done else _tell_stopped)(session)
        return 0 if done else EXIT_INTERRUPTED

    def _check_alone(self) -> None:
        """Refuses what the recipe says itself."""
        for field in dataclasses.fields(self):
            said = getattr(self, field.name) != field.default
            if said and field.name not in _OF_RECIPES:
                option = field.name.replace("_", "-")
                raise UsageError(
                    f"--{option} is for a training without --recipe: a recipe says it, stage by "
                    f"stage, in its file"
                )

    def _check_numbers(self) -> None:
        if self.check_every is not None and self.check_every < 1:
            raise UsageError("--check-every must be at least 1; --check-routes 0 checks nothing")
        if self.check_routes < 0 or (self.workers or 0) < 0:
            raise UsageError("--check-routes and --workers must not be negative")
        if self.threads < 1:
            raise UsageError("--threads must be at least 1")

    def _plan(self) -> TrainingPlan:
        """What the arguments ask for."""
        from agents.training.config import PLANNING, RENDERED, TrainConfig
        from agents.training.session import TrainingPlan
        from agents.training.trainees import config_named

        try:
            policy = config_named(self.config)
            training = TrainConfig(
                steps=self.steps,
                batch=self.batch,
                learning_rate=self.learning_rate,
                planner_rate=self.planner_rate,
                warm_up=min(200, self.steps // 10),
                seed=self.seed,
                overfit=self.overfit,
                threads=self.threads,
                held_out=self.held_out,
                **(PLANNING if self.plan_only else RENDERED),
            )
        except ValueError as error:
            raise UsageError(str(error)) from error
        return TrainingPlan(
            policy=policy,
            training=training,
            data=self.data,
            folder=self.output or Path("runs") / policy.name,
            init_from=self.init_from,
            device=self.device,
            precision=self.precision,
            workers=self.workers,
            cache=self.cache,
        )


def _tell_beginning(session: Session) -> None:
    training, plan = session.training, session.plan
    if session.resumed:
        say(f"Goes on from step {training.step} of {plan.folder}.")
    elif plan.init_from is not None:
        count = f"{len(session.taken)} of {len(training.policy.state_dict())} tensors"
        say(f"Taken from {plan.init_from}: {count}: {_parts(session.taken)}.")
        if session.left:
            say(f"Not taken, as nothing here has their name and shape: {_parts(session.left)}.")


def _parts(names: Sequence[str]) -> str:
    """The parts of a network that tensors belong to, with how many are of each."""
    counts = Counter(name.partition(".")[0] for name in names)
    return ", ".join(f"{part} ({count})" for part, count in counts.items())


def _tell_stopped(session: Session) -> None:
    step, steps = session.training.step, session.training.config.steps
    say(
        f"Stopped at step {step} of {steps}; a checkpoint is written.",
        "Next: the same command again goes on",
    )


def _tell_trained(session: Session) -> None:
    from agents.training.config import HELD_OUT
    from agents.training.log import read_rows, write_curve
    from agents.training.loop import CHECKS_FILE, LOG_FILE, POLICY_FOLDER

    folder = session.plan.folder
    log, checked = read_rows(folder / LOG_FILE), read_rows(folder / CHECKS_FILE)
    curve = folder / "curve.png"
    drawn = write_curve(curve, log, checked)
    kept_out = f" (drives kept out: {log[-1][HELD_OUT]:.3f} m)" if HELD_OUT in log[-1] else ""
    loss = f"{log[-1]['waypoints']:.3f} m at the end{kept_out}"
    say(f"Trained {session.training.step} steps; waypoint loss {loss}.")
    if checked:
        best = max(checked, key=lambda row: row["driving_score"])
        say(f"Drove best at step {best['step']:.0f}: driving score {best['driving_score']:.1f}.")
    policy = folder / POLICY_FOLDER
    training = session.training
    blind = training.trainee.config.sensors and not training.config.rendered
    agent = typed(f"{'true-sight' if blind else training.trainee.scheme}:{policy}")
    say(
        f"Written: {policy}, {folder / LOG_FILE}" + (f", {curve}" if drawn else ""),
        f"Next: driveinsight evaluate --agent {agent} --suite town05_tiny",
    )
