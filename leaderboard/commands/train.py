"""`driveinsight train`: trains a policy on collected drives; goes on where it was stopped."""

from __future__ import annotations

import dataclasses
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.console import Console

from leaderboard.commands.ending import EXIT_INTERRUPTED, UsageError, say
from leaderboard.commands.scene_arguments import says

if TYPE_CHECKING:
    from agents.driveinsight.config import PolicyConfig
    from agents.driveinsight.model import Policy
    from agents.training.config import TrainConfig
    from agents.training.distributed import Team
    from agents.training.learning import Training
    from agents.training.loading import Moments
    from agents.training.loop import Checks
    from leaderboard.running.displays.training import TrainingDisplay

TRAIN_HELP = """Train a policy on what `driveinsight collect` kept.

Examples:
  driveinsight train --config tiny --steps 1500 --check-routes 2     a first try, in minutes
  driveinsight train --config small --data data --output runs/small
  driveinsight train --config small --init-from runs/small-prompt-only/policy
  driveinsight train --config small --overfit 1 --steps 300          can it learn at all?
  torchrun --nproc-per-node 4 -m leaderboard train --config small    four processes, or GPUs

Pictures are rendered while it trains, each sample in a weather of its own. Into --output go a
checkpoint every two minutes, log.csv, curve.png, checks.csv with the driving scores of routes that
it drives on the way, and in policy/ the weights that drove best. After Ctrl-C or a crash the same
command goes on, and comes to the same bits (on a CPU)."""


@dataclass(frozen=True, kw_only=True)
class Train:
    """The arguments of `driveinsight train`."""

    config: Annotated[str, says("NAME", "small")] = "small"
    """Configuration of the policy: tiny, small, small-prompt-only, paper, …"""

    data: Annotated[tuple[Path, ...], says("DIR ...", "data")] = (Path("data"),)
    """Folders of drives: the expert's, and corrections of learners' (`collect --driver`)."""

    output: Annotated[Path | None, says("DIR", "runs/CONFIG")] = None
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
    of each of its processes."""

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

    def run(self) -> int:
        """Trains; returns the exit code."""
        try:
            import torch
        except ImportError as error:
            raise UsageError(
                f"training needs torch: pip install 'driveinsight[policy]' ({error})"
            ) from error
        self._check_numbers()

        from agents.driveinsight.weights import WeightsError
        from agents.training.config import TrainingError
        from agents.training.distributed import joined_team
        from agents.training.frames import DriveFileError
        from agents.training.learning import Training
        from agents.training.loading import load_moments
        from leaderboard.running.training_check import CheckError

        torch.set_num_threads(self.threads)
        try:
            with joined_team(self._device()) as (team, device), _one_talks(team):
                policy, config = self._configs(team)
                with Console(stderr=True).status("reading drives"):
                    moments = load_moments(self.data, config.standing_share)
                held_out = config.held_out if moments.drives > 1 else 0.0  # one is for learning
                config = dataclasses.replace(config, data=moments.digest, held_out=held_out)
                return self._train(Training.begin(policy, config, device, team), moments)
        except (TrainingError, DriveFileError, WeightsError, CheckError, OSError) as error:
            raise UsageError(str(error)) from error

    def _check_numbers(self) -> None:
        if self.check_every is not None and self.check_every < 1:
            raise UsageError("--check-every must be at least 1; --check-routes 0 checks nothing")
        if self.check_routes < 0 or (self.workers or 0) < 0:
            raise UsageError("--check-routes and --workers must not be negative")
        if self.threads < 1:
            raise UsageError("--threads must be at least 1")

    def _configs(self, team: Team) -> tuple[PolicyConfig, TrainConfig]:
        from agents.driveinsight.config import config_named

        try:
            return config_named(self.config), self._training_config(team)
        except ValueError as error:
            raise UsageError(str(error)) from error

    def _training_config(self, team: Team) -> TrainConfig:
        from agents.driveinsight.weights import weights_digest
        from agents.training.config import TrainConfig

        return TrainConfig(
            steps=self.steps,
            batch=self.batch,
            learning_rate=self.learning_rate,
            planner_rate=self.planner_rate,
            warm_up=min(200, self.steps // 10),
            seed=self.seed,
            overfit=self.overfit,
            threads=self.threads,
            precision=self._precision(),
            processes=team.size,
            held_out=0.0 if self.overfit else self.held_out,
            init_from="" if self.init_from is None else weights_digest(self.init_from),
        )

    def _train(self, training: Training, moments: Moments) -> int:
        from agents.training.collect import data_card
        from agents.training.loading import Samples, batches
        from agents.training.loop import train
        from leaderboard.running.compiling import compile_progress
        from leaderboard.running.displays.training import TrainingDisplay
        from leaderboard.running.interruption import interruptible

        policy, config, team = training.policy.config, training.config, training.team
        folder = self.output or Path("runs") / policy.name
        self._go_on(training, folder)
        samples = Samples(policy, config, moments)
        with compile_progress(Console(stderr=True)):
            samples[0]  # before several processes need the same kernels
        workers = _free_cores(team) if self.workers is None else self.workers
        data = batches(samples, first_step=training.step, workers=workers, team=team)
        show = TrainingDisplay(done=training.step, steps=config.steps, batch=config.batch)
        with (
            interruptible() as interruption,
            closing(data),
            show,
            self._checks(training, show, lambda: interruption.requested) as checks,
        ):
            done = train(
                training,
                data,
                folder,
                on_step=show.step,
                stop=lambda: interruption.requested,
                checks=checks,
                about_data={str(folder): data_card(folder) for folder in self.data},
            )
        if not done:
            return _tell_stopped(training)
        return _tell(training, folder) if team.first else 0

    def _go_on(self, training: Training, folder: Path) -> None:
        """Goes on with the training that the folder holds, or with another policy's weights."""
        from agents.driveinsight.weights import take_weights
        from agents.training.loop import CHECKPOINT_FILE

        if (folder / CHECKPOINT_FILE).exists():
            training.load(folder / CHECKPOINT_FILE)
            say(f"Goes on from step {training.step} of {folder}.")
        elif self.init_from is not None:
            taken, left = take_weights(training.policy, self.init_from)
            total = len(training.policy.state_dict())
            say(f"Taken from {self.init_from}: {len(taken)} of {total} tensors: {_parts(taken)}.")
            if left:
                say(f"Not taken, as nothing here has their name and shape: {_parts(left)}.")

    def _device(self) -> str:
        import torch

        if self.device != "auto":
            return self.device
        return "cuda" if torch.cuda.is_available() else "cpu"

    def _precision(self) -> str:
        import torch

        if self.precision != "auto":
            return self.precision
        if self._device() == "cuda":
            fast = torch.cuda.is_bf16_supported(including_emulation=False)
        else:
            fast = torch.cpu.get_capabilities().get("amx_bf16", False)
        return "bfloat16" if fast else "float32"

    @contextmanager
    def _checks(
        self, training: Training, show: TrainingDisplay, stop: Callable[[], bool]
    ) -> Iterator[Checks | None]:
        from agents.training.loop import Checks
        from leaderboard.running.training_check import ClosedLoopCheck

        if not self.check_routes or self.overfit or not training.team.first:
            yield None
            return
        every = self.check_every or max(training.config.steps // 5, 1)
        with (
            TemporaryDirectory(prefix="driveinsight-") as folder,
            ClosedLoopCheck(
                training.policy.config,
                Path(folder),
                self.check_routes,
                stop=stop,
                on_route=show.route,
            ) as check,
        ):

            def score(policy: Policy) -> Mapping[str, float] | None:
                found = check(policy)
                if found is not None:
                    show.checked(found["driving_score"])
                return found

            yield Checks(every=every, score=score)


@contextmanager
def _one_talks(team: Team) -> Iterator[None]:
    """Of a team only the first process is heard, but for errors."""
    if team.first:
        yield
        return
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
        yield


def _free_cores(team: Team) -> int:
    """Each process's part of the cores that are left when each has one; one at least."""
    return max((os.cpu_count() or 2) // team.here - 1, 1)


def _parts(names: Sequence[str]) -> str:
    """The parts of a network that tensors belong to, with how many are of each."""
    counts = Counter(name.partition(".")[0] for name in names)
    return ", ".join(f"{part} ({count})" for part, count in counts.items())


def _tell_stopped(training: Training) -> int:
    say(
        f"Stopped at step {training.step} of {training.config.steps}; a checkpoint is written.",
        "Next: the same command again goes on",
    )
    return EXIT_INTERRUPTED


def _tell(training: Training, folder: Path) -> int:
    from agents.training.log import HELD_OUT, read_rows, write_curve
    from agents.training.loop import CHECKS_FILE, LOG_FILE, POLICY_FOLDER

    log, checked = read_rows(folder / LOG_FILE), read_rows(folder / CHECKS_FILE)
    curve = folder / "curve.png"
    drawn = write_curve(curve, log, checked)
    kept_out = f" (drives kept out: {log[-1][HELD_OUT]:.3f} m)" if HELD_OUT in log[-1] else ""
    loss = f"{log[-1]['waypoints']:.3f} m at the end{kept_out}"
    say(f"Trained {training.step} steps; waypoint loss {loss}.")
    if checked:
        best = max(checked, key=lambda row: row["driving_score"])
        say(f"Drove best at step {best['step']:.0f}: driving score {best['driving_score']:.1f}.")
    policy = folder / POLICY_FOLDER
    say(
        f"Written: {policy}, {folder / LOG_FILE}" + (f", {curve}" if drawn else ""),
        f"Next: driveinsight evaluate --agent driveinsight:{policy} --suite town05_tiny",
    )
    return 0
