"""`RoadOption` at the place where agents for the CARLA Leaderboard import it from."""

from __future__ import annotations

from di_envs.town.plan import RoadOption

__all__ = ["RoadOption"]
