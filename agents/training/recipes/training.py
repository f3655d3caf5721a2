"""Stages that train: a planner alone, from encoded moments, or a whole policy, from pictures."""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import dataclass

from agents.driveinsight.config import config_named as paper_config_named
from agents.training.config import HELD_OUT, PLANNING, RENDERED, TrainConfig
from agents.training.log import read_rows, write_curve
from agents.training.loop import LOG_FILE, train
from agents.training.recipes.kinds import POLICY_FOLDER, SEEN_FOLDER, Made, Progress, StageRun
from agents.training.session import TrainingPlan, begin, joined
from agents.training.trainees import config_named

_CACHE_FOLDER = "encoded-moments"  # beside the stages: what one has encoded, others find
_MEMORY = 0.98  # of the running mean of the waypoint loss


@dataclass(frozen=True, kw_only=True)
class PlanStage:
    """A planner learns alone, from encoded moments and eyes that are lent it.

    Attributes:
        data: Stages whose drives it learns from.
        config: Name of the policy's configuration.
        init_from: Stage whose policy it begins with; empty for fresh weights.
        eyes: Stage whose policy it takes the eyes of, which planning leaves as they are; empty for
            those of `init_from`.
        seen: Stages whose eyes have looked at drives: of these it is shown what was seen there.
        steps: Updates of the weights.
        batch: Samples a step.
        learning_rate: At its highest.
        held_out: Share of the drives that is kept out, to measure by.
    """

    data: tuple[str, ...]
    config: str
    init_from: str = ""
    eyes: str = ""
    seen: tuple[str, ...] = ()
    steps: int = 4000
    batch: int = 128
    learning_rate: float = 1e-3
    held_out: float = 0.05

    def __post_init__(self) -> None:
        paper_config_named(self.config)
        self.training(seed=0)

    @property
    def precision(self) -> str:
        """A planner is too small for less to be faster."""
        return "float32"

    def training(self, seed: int) -> TrainConfig:
        """How it is trained."""
        return TrainConfig(
            steps=self.steps,
            batch=self.batch,
            learning_rate=self.learning_rate,
            warm_up=min(200, self.steps // 10),
            held_out=self.held_out,
            seed=seed,
            **PLANNING,
        )


@dataclass(frozen=True, kw_only=True)
class TrainStage:
    """A whole policy learns from what it sees, rendered on the way.

    Attributes:
        data: Stages whose drives it learns from.
        config: Name of the policy's configuration.
        init_from: Stage whose policy it begins with; empty for fresh weights.
        steps: Updates of the weights.
        batch: Samples a step.
        learning_rate: At its highest.
        planner_rate: What plans learns at, as a share of it.
        held_out: Share of the drives that is kept out, to measure by.
        precision: `float32`, `bfloat16`, or `auto`: what the hardware has built in.
    """

    data: tuple[str, ...]
    config: str
    init_from: str = ""
    steps: int = 4000
    batch: int = 16
    learning_rate: float = 1e-3
    planner_rate: float = 1.0
    held_out: float = 0.05
    precision: str = "auto"

    def __post_init__(self) -> None:
        config_named(self.config)
        self.training(seed=0)

    def training(self, seed: int) -> TrainConfig:
        """How it is trained."""
        return TrainConfig(
            steps=self.steps,
            batch=self.batch,
            learning_rate=self.learning_rate,
            planner_rate=self.planner_rate,
            warm_up=min(200, self.steps // 10),
            held_out=self.held_out,
            seed=seed,
            **RENDERED,
        )


def run_train(run: StageRun) -> Made | None:
    """Trains to the last step; the last weights are kept."""
    settings: TrainStage | PlanStage = run.settings
    init_from, eyes = run.takes["init_from"], run.takes.get("eyes", ())
    plan = TrainingPlan(
        policy=config_named(settings.config),
        training=settings.training(run.seed),
        data=run.takes["data"],
        folder=run.folder,
        init_from=init_from[0] / POLICY_FOLDER if init_from else None,
        eyes=eyes[0] / POLICY_FOLDER if eyes else None,
        device=run.machine.device,
        precision=settings.precision,
        cache=run.folder.parent / _CACHE_FOLDER,
        seen=tuple(folder / SEEN_FOLDER for folder in run.takes.get("seen", ())),
    )
    with joined(plan) as (team, device):
        session = begin(plan, team, device)
        with run.compiling():
            session.warm_up()
        with closing(session.batches()) as data:
            done = train(
                session.training,
                data,
                run.folder,
                on_step=_Told(run, settings, session.training.step).step,
                stop=run.stop,
                about_data=session.about_data(),
            )
    if not done:
        return None
    log = read_rows(run.folder / LOG_FILE)
    write_curve(run.folder / "curve.png", log, [])
    kept_out = f", {log[-1][HELD_OUT]:.3f} m on drives kept out" if HELD_OUT in log[-1] else ""
    said = f"waypoint loss {log[-1]['waypoints']:.3f} m{kept_out}"
    return Made(samples=settings.steps * settings.batch, said=said)


class _Told:
    """Says of each step how far the training has come, how well it does and how fast it is."""

    def __init__(self, run: StageRun, settings: TrainStage | PlanStage, first: int) -> None:
        self._run, self._settings, self._first = run, settings, first
        self._loss_m, self._began_s = 0.0, time.monotonic()

    def step(self, step: int, terms: dict[str, float]) -> None:
        """A step is done."""
        steps = step - self._first
        memory = min(_MEMORY, 1.0 - 1.0 / steps)
        self._loss_m = memory * self._loss_m + (1.0 - memory) * terms["waypoints"]
        rate = steps * self._settings.batch / (time.monotonic() - self._began_s)
        about = f"waypoints {self._loss_m:.2f} m, {rate:.0f} samples/s"
        total = self._settings.steps
        self._run.tell(Progress(done=step, total=total, unit="steps", about=about))
