"""The driver of `transfuser`."""

from __future__ import annotations

from typing import ClassVar

from agents.zoo.controls import PidT
from agents.zoo.driving import SystemAgent


class TransfuserAgent(SystemAgent):
    """Drives with it: this version of 2021 had a controller, and no rules on top of it."""

    published: ClassVar[PidT | None] = PidT()
