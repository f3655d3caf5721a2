"""Radars by configuration: cone, range, rays a second, mounting.

Source: attributes as of CARLA's `sensor.other.radar`; points a second and range as the Leaderboard
sets them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from di_envs.world.kinds import TICK_S

MOST_RADARS = 16  # of an ego


@dataclass(frozen=True, kw_only=True)
class RadarConfig:
    """One radar.

    Attributes:
        name: Its key in the observation, such as `radar_front`.
        fov_deg: Full angle of its cone, across and upright.
        range_m: Beyond it nothing is met.
        points_per_s: Rays a second.
        x_m: Mounting in the ego's frame, ahead.
        y_m: … to the right.
        z_m: … above the ground.
        yaw_rad: Turned to the right.
        pitch_rad: Lifted.
        roll_rad: Turned about its axis, its right side down.
    """

    name: str
    fov_deg: float = 30.0
    range_m: float = 100.0
    points_per_s: int = 1500
    x_m: float = 2.0
    y_m: float = 0.0
    z_m: float = 1.0
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.fov_deg < 180.0:
            raise ValueError(
                f"Radar '{self.name}' needs a cone of 0 to 180 degrees, both excluded; got "
                f"{self.fov_deg!r}."
            )
        if not 0.0 < self.range_m <= 200.0:
            raise ValueError(
                f"Radar '{self.name}' sees 0 to 200 m far, above 0; got {self.range_m!r}."
            )
        if not TICK_S * self.points_per_s >= 1.0 or self.points_per_s > 1_000_000:
            raise ValueError(
                f"Radar '{self.name}' needs 20 to 1,000,000 points a second; got "
                f"{self.points_per_s!r}."
            )
        for place in ("x_m", "y_m", "z_m", "yaw_rad", "pitch_rad", "roll_rad"):
            if not math.isfinite(getattr(self, place)):
                raise ValueError(f"Radar '{self.name}': {place} must be a finite number.")

    @property
    def rays(self) -> int:
        """Rays of a look, the rows of the observation: those of one tick."""
        return int(self.points_per_s * TICK_S)

    def ego_from_radar(self) -> NDArray[np.float64]:
        """(3, 3) turns (ahead, right, up) of the radar into those of the ego."""
        cy, sy = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        cp, sp = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
        cr, sr = math.cos(self.roll_rad), math.sin(self.roll_rad)
        yaw = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
        pitch = np.array([[cp, 0.0, -sp], [0.0, 1.0, 0.0], [sp, 0.0, cp]])
        roll = np.array([[1.0, 0.0, 0.0], [0.0, cr, sr], [0.0, -sr, cr]])
        turn: NDArray[np.float64] = yaw @ pitch @ roll
        return turn


FRONT_RADAR = (RadarConfig(name="radar_front"),)  # where nobody says which


def checked_radars(radars: Iterable[RadarConfig]) -> tuple[RadarConfig, ...]:
    """Radars that an ego can carry.

    Raises:
        ValueError: If they are no radars, too many or none, or two have one name.
    """
    found = tuple(radars)
    names = [getattr(radar, "name", radar) for radar in found]
    if not all(isinstance(radar, RadarConfig) for radar in found):
        raise ValueError(f"radars are di_envs.sensors.radar.config.RadarConfigs; got {names}.")
    if not 1 <= len(set(names)) == len(names) <= MOST_RADARS:
        raise ValueError(
            f"An ego carries 1 to {MOST_RADARS} radars with names of their own; got {names}."
        )
    return found
