"""How often a learner is shown each moment, and what of it can be foreseen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agents.training.foreseen import foreseen
from agents.training.interest import draw_weights


@dataclass(frozen=True, kw_only=True)
class Emphasis:
    """Of M moments.

    Attributes:
        weights: (M,) how often each is drawn beside one at which there is nothing.
        known: (M, T) which of its waypoints can be foreseen.
    """

    weights: NDArray[np.float64]
    known: NDArray[np.bool_]

    @classmethod
    def of(cls, rows: NDArray[np.void], interest: Mapping[str, float]) -> Emphasis:
        """From (M,) of `caching.MOMENT`, and `TrainConfig.interest`."""
        return cls(weights=draw_weights(rows, interest), known=foreseen(rows))


def cumulated(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """(M,) up to which draw from 0 to 1 each of them is meant."""
    return np.cumsum(weights) / weights.sum()


def meant(up_to: NDArray[np.float64], drawn: NDArray[np.float64]) -> NDArray[np.int64]:
    """(B,) which of them draws from 0 to 1 mean; `up_to` is `cumulated`."""
    return np.searchsorted(up_to, drawn, side="right").clip(max=len(up_to) - 1)
