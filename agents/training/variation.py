"""How samples are varied: the weather, and how far the ego is set aside from where it was.

From a place aside the expert's true path leads back: so a policy learns to recover.
"""

from __future__ import annotations

from dataclasses import dataclass

from di_envs.config import WEATHERS
from di_envs.numerics.keyed_random import Stream, uniform

FOURTEEN_WEATHERS = WEATHERS[:14]


@dataclass(frozen=True, kw_only=True)
class Variation:
    """How samples are varied.

    Attributes:
        aside_m: The ego is set aside by up to so much to either side.
        turn_rad: … and turned by up to so much.
        share: Of samples that are.
        weathers: One of them is drawn for each sample.
    """

    aside_m: float = 1.0
    turn_rad: float = 0.15
    share: float = 0.7
    weathers: tuple[str, ...] = FOURTEEN_WEATHERS


NO_VARIATION = Variation(share=0.0, weathers=("ClearNoon",))


def drawn(variation: Variation, key: int) -> tuple[float, float, str]:
    """How far aside, how far turned, and in which weather."""
    draws = [float(uniform(key, int(Stream.AGENT), k, 0)) for k in range(4)]
    weather = variation.weathers[int(draws[3] * len(variation.weathers))]
    if draws[0] >= variation.share:
        return 0.0, 0.0, weather
    aside = (2.0 * draws[1] - 1.0) * variation.aside_m
    return aside, (2.0 * draws[2] - 1.0) * variation.turn_rad, weather
