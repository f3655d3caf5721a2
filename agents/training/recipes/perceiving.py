"""The stage that trains a policy's eyes alone, on what the simulator knows to be there."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import torch

from agents.driveinsight.config import config_named
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import take_weights
from agents.training.log import read_rows
from agents.training.loop import LOG_FILE
from agents.training.perceive_config import PerceiveConfig
from agents.training.perceiving import perceive
from agents.training.recipes.kinds import POLICY_FOLDER, Made, Progress, StageRun
from agents.training.session import chosen_device, chosen_precision


@dataclass(frozen=True, kw_only=True)
class PerceiveStage:
    """Eyes learn to see; see `PerceiveConfig` for what is not said here.

    Attributes:
        data: Stages whose drives they look at.
        config: Name of the policy's configuration.
        init_from: Stage whose policy it begins with; empty for fresh weights.
        steps: Updates of the weights.
        batch: Sequences a step.
        length: Moments of a sequence.
        learning_rate: At its highest.
        held_out: Share of the drives that is kept out, to measure by.
        precision: `float32`, `bfloat16`, or `auto`: what the hardware has built in.
    """

    data: tuple[str, ...]
    config: str = "driveinsight"
    init_from: str = ""
    steps: int = 4000
    batch: int = 5
    length: int = 4
    learning_rate: float = 2e-3
    held_out: float = 0.05
    precision: str = "auto"

    def __post_init__(self) -> None:
        if not config_named(self.config).sensors:
            raise ValueError(f"'{self.config}' has no sensors: there is nothing to train to see")
        self.training(seed=0, precision="float32")

    def training(self, seed: int, precision: str) -> PerceiveConfig:
        """How they are trained."""
        return PerceiveConfig(
            steps=self.steps,
            batch=self.batch,
            length=self.length,
            learning_rate=self.learning_rate,
            warm_up=min(200, self.steps // 10),
            held_out=self.held_out,
            precision=precision,
            seed=seed,
        )


def run_perceive(run: StageRun) -> Made | None:
    """Trains to the last step; the last weights are kept."""
    settings: PerceiveStage = run.settings
    device = chosen_device(run.machine.device)
    torch.set_num_threads(1)  # another number gives other bits
    torch.manual_seed(run.seed)
    policy = Policy(config_named(settings.config)).to(device)
    if run.takes["init_from"]:
        take_weights(policy, run.takes["init_from"][0] / POLICY_FOLDER)
    began_s, first = time.monotonic(), list[int]()

    def tell(step: int, terms: Mapping[str, float]) -> None:
        if not first:
            first.append(step - 1)
        steps = step - first[0]
        rate = steps * settings.batch * settings.length / (time.monotonic() - began_s)
        about = f"loss {terms['total']:.2f}, {rate:.1f} moments/s"
        run.tell(Progress(done=step, total=settings.steps, unit="steps", about=about))

    precision = chosen_precision(settings.precision, device, convolves=True)
    config = settings.training(run.seed, precision)
    done = perceive(
        policy,
        config,
        run.takes["data"],
        run.folder,
        workers=run.machine.workers,
        tell=tell,
        stop=run.stop,
    )
    if not done:
        return None
    last = read_rows(run.folder / LOG_FILE)[-1]
    said = ", ".join(
        f"{name.replace('_', ' ')} {last[name]:.2f}"
        for name in ("iou_vehicle", "vehicles_found", "walkers_found", "state_right")
        if name in last
    )
    return Made(samples=settings.steps * settings.batch * settings.length, said=said)
