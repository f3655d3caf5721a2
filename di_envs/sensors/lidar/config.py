"""LiDAR by configuration: channels, rays, range, mounting; the sensors that are shipped.

A sweep is taken at one instant, from the ego's present pose: 10 sweeps a second at the default
control step of 0.1 s, without the smear of a turning sensor. An environment that steps at 0.05 s
sees half a sweep at a time (see `lidar.py`), one that steps less often the latest whole sweep.

Channels are spread evenly from `upper_deg` down to `lower_deg`; in azimuth a sweep starts straight
ahead and turns clockwise, seen from above. Ray `step * channels + channel` is the one of that step
in azimuth, channel 0 on top.

Source: attributes and their defaults are those of CARLA's `sensor.lidar.ray_cast`; range and mount
follow the Leaderboard's agent wrapper and TransFuser's (Chitta et al., PAMI 2023) sensor set-up.
CARLA's own default range is 10 m, which sees less than a crossing: all presets reach 85 m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from di_envs.files.names import name_hint

LARGEST_SIDE = 8192
SWEEP_S = 0.1  # time of a turn, as the Leaderboard sets it


@dataclass(frozen=True, kw_only=True)
class LidarConfig:
    """One spinning LiDAR.

    Attributes:
        channels: Lasers, one above the other.
        steps: Directions of a sweep; it has `channels * steps` rays.
        upper_deg: Elevation of the topmost laser.
        lower_deg: … of the lowest, below `upper_deg`.
        range_m: Beyond it nothing is hit.
        x_m: Mounting in the ego's frame, ahead.
        y_m: … to the right.
        z_m: … above the ground.
        attenuation_per_m: a of the intensity exp(-a d) of a hit at d metres.
        dropoff: Share of rays that never come back.
        dropoff_intensity: Hits of more intensity than this are not dropped besides.
        dropoff_zero: Share of the other hits that would be dropped at intensity 0; it falls
            linearly to 0 at `dropoff_intensity`.
        noise_m: Standard deviation of a hit's distance.
        semantic: Add `lidar_semantic`: (rays,) uint8, `Tag`, NONE for rays without a hit.
        instance: Add `lidar_instance`: (rays,) int32, actor id + 1 of what was hit, 0 for what is
            no actor; and `lidar_incidence`: (rays,) float32, cosine of the angle between the ray
            and what it hit, 0 for rays without a hit.
    """

    channels: int = 32
    steps: int = 175
    upper_deg: float = 10.0
    lower_deg: float = -30.0
    range_m: float = 85.0
    x_m: float = 1.3
    y_m: float = 0.0
    z_m: float = 2.5
    attenuation_per_m: float = 0.004
    dropoff: float = 0.45
    dropoff_intensity: float = 0.8
    dropoff_zero: float = 0.4
    noise_m: float = 0.0
    semantic: bool = False
    instance: bool = False

    def __post_init__(self) -> None:
        for side, least in (("channels", 2), ("steps", 4)):
            count = getattr(self, side)
            whole = not isinstance(count, bool) and int(count) == count
            if not whole or not least <= count <= LARGEST_SIDE:
                raise ValueError(
                    f"A LiDAR needs {least} to {LARGEST_SIDE} {side}; got {count!r}. The preset "
                    f"paper has 32 channels and 175 steps."
                )
        if not -80.0 <= self.lower_deg < self.upper_deg <= 80.0:
            raise ValueError(
                f"A LiDAR's channels go from upper_deg down to lower_deg, both within 80 degrees "
                f"of level; got upper_deg={self.upper_deg!r}, lower_deg={self.lower_deg!r}."
            )
        if not 0.0 < self.range_m <= 200.0:
            raise ValueError(f"A LiDAR sees 0 to 200 m far, above 0; got {self.range_m!r}.")
        for share in ("dropoff", "dropoff_intensity", "dropoff_zero"):
            if not 0.0 <= getattr(self, share) <= 1.0:
                raise ValueError(f"{share} is a share from 0 to 1; got {getattr(self, share)!r}.")
        for amount in ("attenuation_per_m", "noise_m"):
            if not 0.0 <= getattr(self, amount) <= 10.0:
                raise ValueError(f"{amount} is from 0 to 10; got {getattr(self, amount)!r}.")
        for place in ("x_m", "y_m", "z_m"):
            if not abs(getattr(self, place)) <= 20.0:
                raise ValueError(
                    f"A LiDAR is mounted within 20 m of the ego's origin; got "
                    f"{place}={getattr(self, place)!r}."
                )

    @property
    def rays(self) -> int:
        """Rays of a sweep, the rows of the observation."""
        return self.channels * self.steps

    @property
    def half_steps(self) -> int:
        """Steps of half a sweep, which is what one world tick scans; rounded up."""
        return (self.steps + 1) // 2

    @property
    def reach_m(self) -> float:
        """How far a hit can be from the ego's origin."""
        return self.range_m + math.hypot(self.x_m, self.y_m, self.z_m)


LIDARS = {
    "paper": LidarConfig(),  # 5,600 rays: 56,000 points a second at 10 Hz, CARLA's default
    "leaderboard": LidarConfig(channels=64, steps=937),  # 600,000 points a second
    "dense": LidarConfig(channels=32, steps=1800, dropoff=0.0, dropoff_zero=0.0),
}


def lidar_of(lidar: str | LidarConfig) -> LidarConfig:
    """A configuration, or the shipped one of a name.

    Raises:
        ValueError: If there is none of that name; suggests one.
    """
    if isinstance(lidar, LidarConfig):
        return lidar
    if lidar not in LIDARS:
        raise ValueError(
            f"Unknown lidar {lidar!r}; {name_hint(lidar, LIDARS)}, or give a "
            f"di_envs.sensors.lidar.config.LidarConfig."
        )
    return LIDARS[lidar]
