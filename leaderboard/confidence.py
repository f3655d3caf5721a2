"""A mean with its confidence interval over seeds: no table shows a number without its doubt.

Source: Student, "The Probable Error of a Mean", Biometrika 1908; large degrees of freedom by the
expansion of Abramowitz and Stegun, Handbook of Mathematical Functions 1964, 26.7.5.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

# 97.5 % quantiles of Student's t for 1, 2, … 10 degrees of freedom
_T_975 = (12.7062, 4.3027, 3.1824, 2.7764, 2.5706, 2.4469, 2.3646, 2.3060, 2.2622, 2.2281)
_Z_975 = 1.959963985


@dataclass(frozen=True, kw_only=True)
class Interval:
    """A mean and the half width of its 95 % interval, None where there is but one value."""

    mean: float
    half_width: float | None

    def __str__(self) -> str:
        return f"{self.mean:.1f}" + ("" if self.half_width is None else f" ± {self.half_width:.1f}")


def t_quantile(degrees: int) -> float:
    """The 97.5 % quantile of Student's t.

    Raises:
        ValueError: If `degrees` of freedom are below 1.
    """
    if degrees < 1:
        raise ValueError(f"Student's t needs at least 1 degree of freedom, not {degrees}")
    if degrees <= len(_T_975):
        return _T_975[degrees - 1]
    z = _Z_975
    terms = (
        (z**3 + z) / 4.0,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96.0,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384.0,
    )
    return z + sum(term / degrees ** (power + 1) for power, term in enumerate(terms))


def mean_interval(values: Sequence[float]) -> Interval:
    """The 95 % t-interval of the mean of independent values, such as one mean a seed.

    Raises:
        ValueError: If there are no values.
    """
    if not values:
        raise ValueError("a mean needs at least one value")
    count = len(values)
    mean = math.fsum(values) / count
    if count == 1:
        return Interval(mean=mean, half_width=None)
    variance = math.fsum((value - mean) ** 2 for value in values) / (count - 1)
    return Interval(mean=mean, half_width=t_quantile(count - 1) * math.sqrt(variance / count))
