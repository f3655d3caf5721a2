"""What is said of an agent for the CARLA Leaderboard behind the `?` of `carla:FILE?…`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from agents import AgentSpecError
from di_envs.config import check_name
from di_envs.sensors.carla_suite import LEADERBOARDS, LIMITS
from di_envs.sensors.geo_origin import checked_origin

NULL_ISLAND = (0.0, 0.0)  # the origin that agents for CARLA 0.9.10 have in their code
MAP_ORIGIN = "map"
TRACKS = ("PRIVILEGED",)


@dataclass(frozen=True, kw_only=True)
class CarlaOptions:
    """How an agent's file is driven.

    Attributes:
        config: Handed to its `setup`, unread; empty if there is none.
        leaderboard: `1.0`, `2.0` or `2.1`; None to read it off its class.
        origin: `map`, or `LAT,LON` in degrees: where on Earth GNSS has x = y = 0. None for 0, 0
            with Leaderboard 1.0 and for what the map says with 2.x.
        limits: `leaderboard` to refuse the sensors that the Leaderboard refuses; `none`.
        path: Folders, with commas between, from which its imports come first.
        track: `PRIVILEGED` for one that asks `CarlaDataProvider` for the truth; None.
    """

    config: str = ""
    leaderboard: str | None = None
    origin: str | None = None
    limits: str = "none"
    path: tuple[Path, ...] = field(default=())
    track: str | None = None

    def __post_init__(self) -> None:
        try:
            if self.leaderboard is not None:
                check_name(self.leaderboard, LEADERBOARDS, "leaderboard")
            if self.track is not None:
                check_name(self.track, TRACKS, "track")
            check_name(self.limits, LIMITS, "limits")
            if self.origin not in (None, MAP_ORIGIN):
                checked_origin(str(self.origin).split(","))
        except ValueError as error:
            raise AgentSpecError(str(error)) from error
        for folder in self.path:
            if not folder.is_dir():
                raise AgentSpecError(f"path: there is no folder {folder.absolute()}.")

    def gnss_origin(self, leaderboard: str) -> tuple[float, float] | None:
        """Latitude and longitude [deg] of x = y = 0; None for what the map says."""
        if self.origin is None:
            return NULL_ISLAND if leaderboard == "1.0" else None
        if self.origin == MAP_ORIGIN:
            return None
        return checked_origin(self.origin.split(","))


def folders_of(text: str) -> tuple[Path, ...]:
    """Folders with commas between."""
    return tuple(Path(part) for part in text.split(",") if part)
