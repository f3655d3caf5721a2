"""The driver of `thinktwice`."""

from __future__ import annotations

from typing import ClassVar

from agents.zoo.two_heads import TwoHeads, TwoHeadsAgent


class ThinkTwiceAgent(TwoHeadsAgent):
    """Drives by both heads; who has stood for a second goes if one of them would."""

    heads: ClassVar[TwoHeads] = TwoHeads(throttle=(0.6, 0.4), fast_mps=(3.5, 1.5), stuck=10)
