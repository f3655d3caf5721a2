"""The driver of `lbc` and of its teacher."""

from __future__ import annotations

from typing import ClassVar

from agents.zoo.controls import PidT
from agents.zoo.driving import SystemAgent


class LbcAgent(SystemAgent):
    """Drives with either; its controller brakes below 0.4 m/s, and there are no other rules."""

    published: ClassVar[PidT | None] = PidT(brake_mps=0.4)
