"""Responses made up by hand: as many moments as a sentence needs."""

from __future__ import annotations

from typing import Any

import numpy as np

from agents.explain.situations import SITUATIONS
from leaderboard.responding.drive_responses import DriveResponses


def made_drive(
    gradient: Any,
    *,
    route: str = "0",
    seed: int = 0,
    groups: tuple[str, ...] = ("traffic_lights", "speed"),
    attention: Any = None,
    events: tuple[tuple[float, str], ...] = (),
    **holding: Any,
) -> DriveResponses:
    """A drive of N moments from (N, G) Gx; situations by name, (N,) each."""
    gx = np.array(gradient, np.float32)
    count = len(gx)
    return DriveResponses(
        route_id=route,
        seed=seed,
        agent="driveinsight:some/folder",
        drive="0" * 16,
        route_hash=route,
        every_s=0.5,
        events=events,
        groups=groups,
        situations=SITUATIONS,
        time_s=np.arange(count) * 0.5,
        speed_mps=np.zeros(count, np.float32),
        gradient=np.stack([gx, np.zeros_like(gx)], axis=2),
        attention=np.zeros((count, 0, 0, len(groups)), np.float32)
        if attention is None
        else np.array(attention, np.float32),
        waypoints=np.zeros((count, 8, 2), np.float32),
        holds=np.array([holding.get(name, [False] * count) for name in SITUATIONS], bool).T,
    )
