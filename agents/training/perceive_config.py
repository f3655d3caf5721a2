"""How eyes are trained: every number that decides what comes out, as one frozen value."""

from __future__ import annotations

from dataclasses import dataclass, field

from agents.driveinsight.perception_losses import PerceptionWeights
from agents.training.variation import Variation


@dataclass(frozen=True, kw_only=True)
class PerceiveConfig:
    """How eyes are trained.

    Attributes:
        steps: Updates of the weights.
        batch: Sequences a step.
        length: Moments of a sequence, 0.5 s apart; each is supervised.
        learning_rate: At its highest, after the warm-up; it falls to 0 along a cosine.
        warm_up: Steps over which it rises.
        weight_decay: AdamW's.
        clip: Largest norm of the gradient.
        seed: Of initial weights and of everything that is drawn.
        standing_share: Of moments at which the ego stands and will stand, this share is taken.
        precision: `float32`, or `bfloat16` for products and convolutions (mixed precision).
        held_out: Share of the drives that is kept out of training, to measure by.
        measured: Sequences of these that are looked at …
        measured_every: … after so many steps.
        variation: How sequences are varied.
        weights: Of the terms of the loss.
    """

    steps: int = 4000
    batch: int = 5
    length: int = 4
    learning_rate: float = 2e-3
    warm_up: int = 200
    weight_decay: float = 1e-2
    clip: float = 5.0
    seed: int = 0
    standing_share: float = 0.2
    precision: str = "float32"
    held_out: float = 0.05
    measured: int = 100
    measured_every: int = 500
    variation: Variation = field(default_factory=Variation)
    weights: PerceptionWeights = field(default_factory=PerceptionWeights)

    def __post_init__(self) -> None:
        for name in ("steps", "batch", "length", "measured_every"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")

    def measured_after(self, step: int) -> bool:
        """Whether the eyes are measured on drives kept out after so many steps."""
        return self.held_out > 0.0 and (step % self.measured_every == 0 or step == self.steps)

    @property
    def measured_sequences(self) -> int:
        """Sequences that are measured on, in whole batches."""
        return self.measured // self.batch * self.batch
