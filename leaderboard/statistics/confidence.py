"""A mean with its confidence interval over seeds: no table shows a number without its doubt.

Source: Student, "The Probable Error of a Mean", Biometrika 1908; quantiles by the
finite sums of Abramowitz and Stegun, Handbook of Mathematical Functions 1964, 26.7.3 and 26.7.4.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

_BISECTIONS = 80  # each halves the angle that holds the quantile: more than a float has digits


@dataclass(frozen=True, kw_only=True)
class MeanInterval:
    """A mean and the half width of its 95 % interval, None where there is but one value."""

    mean: float
    half_width: float | None

    def __str__(self) -> str:
        return f"{self.mean:.1f}" + ("" if self.half_width is None else f" ± {self.half_width:.1f}")


def t_quantile(degrees: int, probability: float = 0.975) -> float:
    """A quantile of Student's t.

    Args:
        degrees: Of freedom.
        probability: 0.5 or more, below 1.

    Raises:
        ValueError: If `degrees` are below 1, or the probability is out of range.
    """
    if degrees < 1:
        raise ValueError(f"Student's t needs at least 1 degree of freedom, not {degrees}")
    if not 0.5 <= probability < 1.0:
        raise ValueError(f"a quantile is asked for in [0.5, 1), not at {probability}")
    low, high = 0.0, 0.5 * math.pi
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if 0.5 * (1.0 + _within(middle, degrees)) < probability:
            low = middle
        else:
            high = middle
    return math.sqrt(degrees) * math.tan(low)


def _within(angle: float, degrees: int) -> float:
    """How probably |t| is below sqrt(degrees) * tan(angle), by the finite sums of 26.7.3 and 4."""
    sin, cos = math.sin(angle), math.cos(angle)
    odd = degrees % 2
    total, term = 0.0, cos if odd else 1.0
    for power in range(odd, degrees - 1, 2):
        total += term
        term *= cos * cos * (power + 1) / (power + 2)
    return 2.0 / math.pi * (angle + sin * total) if odd else sin * total


def mean_interval(values: Sequence[float]) -> MeanInterval:
    """The 95 % t-interval of the mean of independent values, such as one mean a seed.

    Raises:
        ValueError: If there are no values.
    """
    if not values:
        raise ValueError("a mean needs at least one value")
    count = len(values)
    mean = math.fsum(values) / count
    if count == 1:
        return MeanInterval(mean=mean, half_width=None)
    variance = math.fsum((value - mean) ** 2 for value in values) / (count - 1)
    return MeanInterval(mean=mean, half_width=t_quantile(count - 1) * math.sqrt(variance / count))
