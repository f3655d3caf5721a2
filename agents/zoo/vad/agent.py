"""The driver of `vad`."""

from __future__ import annotations

from typing import ClassVar

from agents.zoo.controls import PidT
from agents.zoo.driving import SystemAgent


class VadAgent(SystemAgent):
    """Drives with it: waypoints by two PID controllers, no other rules."""

    published: ClassVar[PidT | None] = PidT()
