"""The driver of `st-p3`."""

from __future__ import annotations

from typing import ClassVar

from agents.zoo.controls import PidT
from agents.zoo.driving import SystemAgent


class StP3Agent(SystemAgent):
    """Drives with it: its controller brakes at 1.2 times the wanted speed, no other rules."""

    published: ClassVar[PidT | None] = PidT(brake_ratio=1.2)
