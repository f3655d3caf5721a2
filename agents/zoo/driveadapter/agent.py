"""The driver of `driveadapter`."""

from __future__ import annotations

from typing import ClassVar

from agents.zoo.two_heads import TwoHeads, TwoHeadsAgent


class DriveAdapterAgent(TwoHeadsAgent):
    """Drives by both heads; who has stood for five seconds goes if one of them would."""

    heads: ClassVar[TwoHeads] = TwoHeads(throttle=(0.75, 0.75), fast_mps=(3.0, 2.5), stuck=50)
