"""How a policy is trained: every number that decides what comes out, as one frozen value."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from agents.driveinsight.config import TOKENS
from agents.driveinsight.losses import LossConfig
from agents.training.interest import INTEREST
from agents.training.seen_noise import EyeConfig
from agents.training.variation import NO_VARIATION, Variation
from di_envs.config import check_name

HELD_OUT = "held_out"  # column of the log: the waypoint loss [m] on drives kept out of training
_TOLD = "map+obstacles+traffic_lights+stop_signs"
# How a planner is trained alone: nothing is rendered, and it is measured without what matters
PLANNING: Mapping[str, Any] = MappingProxyType(
    {
        "rendered": False,
        "interest": dict(INTEREST),
        "mistold": 0.4,
        "turned_red": 0.3,
        "among_others": 0.6,
        "measured_moments": 512,
        "measured_every": 500,
        "without": ("obstacles", "bev", "obstacles+bev", "traffic_lights", _TOLD, f"{_TOLD}+bev"),
    }
)
# How what sees and plans together is trained: what is rare is shown more often there, too, and who
# stands and stays less often: of few samples it is else learnt that whoever stands stands on
RENDERED: Mapping[str, Any] = MappingProxyType(
    {"interest": dict(INTEREST), "mistold": 0.4, "standing_share": 0.1}
)


class TrainingError(Exception):
    """Training cannot begin or go on; the message says why and what to do."""


@dataclass(frozen=True, kw_only=True)
class TrainConfig:
    """How a policy is trained.

    Attributes:
        steps: Updates of the weights.
        batch: Samples a step; each is a sequence of `memory_frames + 1` moments.
        learning_rate: At its highest, after the warm-up; it falls to 0 along a cosine.
        planner_rate: That of the prompt's encoders and the planner, as a share of it: below 1 where
            they were trained before.
        warm_up: Steps over which it rises.
        weight_decay: AdamW's.
        clip: Largest norm of the gradient.
        seed: Of initial weights and of everything that is drawn.
        standing_share: Of moments at which the ego stands and will stand, this share is taken.
        overfit: Learn so many samples by heart, unvaried and with nothing hidden; 0 to learn all.
        threads: Of torch; another number gives other bits.
        precision: `float32`, or `bfloat16` for products and convolutions (mixed precision).
        processes: That share each batch (`distributed`); another number gives other bits.
        held_out: Share of the drives that is kept out of training, to measure by.
        measured_moments: So many moments of these are looked at …
        measured_every: … after so many steps.
        without: … given all, and without these components, joined by '+'.
        rendered: Whether sensors are; False learns to plan alone, from what truly is in sight.
        eyes: How bad the eyes are that see it.
        interest: By what there is near the way, how much more often a moment is shown; see
            `interest.reasons`. Nothing shows all of them equally often, and all that came of them.
        mistold: Share of the samples that are told wrong speeds; see `told_speeds`.
        turned_red: Share of the samples of a planner that learns alone that stand or come before a
            green light and are told, and shown, that it is red; see `turned_red`.
        among_others: Share of the samples of such a planner that wait at a red light and are given
            the surroundings of another one; see `waiting.among_others`.
        variation: How samples are varied.
        loss: Weights of the auxiliary terms.
        data: Digest of the drives; see `load_moments`.
        init_from: Digest of the weights that it began from; empty for fresh ones.
        seen: Digest of what the policy's own eyes have seen; empty where it is lent eyes.
    """

    steps: int = 4000
    batch: int = 16
    learning_rate: float = 1e-3
    planner_rate: float = 1.0
    warm_up: int = 200
    weight_decay: float = 1e-2
    clip: float = 5.0
    seed: int = 0
    standing_share: float = 0.3
    overfit: int = 0
    threads: int = 1
    precision: str = "float32"
    processes: int = 1
    held_out: float = 0.0
    measured_moments: int = 64
    measured_every: int = 200
    without: tuple[str, ...] = ()
    rendered: bool = True
    eyes: EyeConfig = field(default_factory=EyeConfig)
    interest: Mapping[str, float] = field(default_factory=dict)
    mistold: float = 0.0
    turned_red: float = 0.0
    among_others: float = 0.0
    variation: Variation = field(default_factory=Variation)
    loss: LossConfig = field(default_factory=LossConfig)
    data: str = ""
    init_from: str = ""
    seen: str = ""

    def __post_init__(self) -> None:
        for name in ("steps", "batch", "threads", "processes", "measured_every"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")
        for name in ("overfit", "warm_up"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must not be negative, not {getattr(self, name)}")
        if self.batch % self.processes:
            raise ValueError(
                f"{self.processes} processes cannot share batches of {self.batch} evenly: choose a "
                f"multiple"
            )
        if not 0.0 <= self.held_out <= 0.5:
            raise ValueError(f"held_out must be a share from 0 to 0.5, not {self.held_out}")
        for names in self.without:
            for name in names.split("+"):
                check_name(name, TOKENS, "component that a policy is measured without")
        check_name(self.precision, ("float32", "bfloat16"), "precision")
        if not self.learning_rate > 0.0:
            raise ValueError(f"learning_rate must be positive, not {self.learning_rate}")
        if not self.planner_rate >= 0.0:
            raise ValueError(f"planner_rate must not be negative, not {self.planner_rate}")

    @property
    def varied(self) -> Variation:
        """How samples are varied: not at all when they are learnt by heart."""
        return NO_VARIATION if self.overfit else self.variation

    @property
    def measured(self) -> int:
        """Moments of the drives kept out that are looked at each time, in whole batches."""
        return -(-self.measured_moments // self.batch) * self.batch if self.held_out else 0

    @property
    def measures(self) -> dict[str, str]:
        """Columns of the log for drives kept out, and what is hidden there."""
        return {HELD_OUT: ""} | {f"{HELD_OUT} without {names}": names for names in self.without}

    def measured_after(self, step: int) -> bool:
        """Whether the policy is measured on these after so many steps."""
        return self.held_out > 0.0 and (step % self.measured_every == 0 or step == self.steps)

    def to_mapping(self) -> dict[str, Any]:
        """As plain values."""
        return dataclasses.asdict(self)
