"""The driver of `ego-only`; it has no rules."""

from __future__ import annotations

from agents.zoo.driving import SystemAgent


class EgoOnlyAgent(SystemAgent):
    """Drives with it."""
