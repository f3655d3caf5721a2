"""The arguments of `driveinsight drive`, as the command line reads them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

DRIVE_DESCRIPTION = """Drive one route and watch: its events, its score, and a video if wanted.

Examples:
  driveinsight drive --agent expert --suite town05_long --route 3
  driveinsight drive --agent expert --suite town05_long --route 3 --video out.mp4
  driveinsight drive --agent path/to/mine.py:MyAgent --suite town05_tiny --video out.gif

The drive is the one that `evaluate` scores for this route and seed, bit for bit."""


@dataclass(frozen=True, kw_only=True)
class Drive:
    """The arguments of `driveinsight drive`."""

    agent: Annotated[str, tyro.conf.arg(metavar="AGENT")]
    """A name (see `driveinsight agents`), module:Class, or path/to/file.py:Class."""

    suite: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="")] = None
    """A shipped set of routes (see `driveinsight suites`); needless with --routes."""

    route: Annotated[
        str | None, tyro.conf.arg(metavar="ID", help_behavior_hint="(default: the first)")
    ] = None
    """Id of the route to drive."""

    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Which seed's world to drive in."""

    video: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: none)")
    ] = None
    """Write a video: .mp4, .mkv, .mov, or .gif."""

    no_camera: tyro.conf.FlagCreatePairsOff[bool] = False
    """Leave the front camera out of the video."""

    town: Annotated[
        str | None, tyro.conf.arg(metavar="NAME|FILE", help_behavior_hint="(default: the suite's)")
    ] = None
    """A shipped town's name or an OpenDRIVE file."""

    routes: Annotated[
        str | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: the suite's)")
    ] = None
    """A route file in CARLA's XML."""

    signals: Annotated[
        str | None, tyro.conf.arg(metavar="NAME|FILE", help_behavior_hint="(default: the map's)")
    ] = None
    """For maps without signals: a sidecar file, a shipped one's name, or `synthesise`."""

    traffic: Annotated[
        int | None, tyro.conf.arg(metavar="N", help_behavior_hint="(default: the suite's)")
    ] = None
    """Number of other vehicles."""

    walkers: Annotated[
        int | None, tyro.conf.arg(metavar="N", help_behavior_hint="(default: the suite's)")
    ] = None
    """Number of walkers."""

    weather: Annotated[
        str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(default: the suite's)")
    ] = None
    """One of CARLA's presets, such as HardRainNoon; seen by cameras."""

    rules: Annotated[str, tyro.conf.arg(metavar="NAME")] = "carla-1.0"
    """Name of the scoring rules."""

    @property
    def route_ids(self) -> tuple[str, ...]:
        """The one route, as options of an environment name routes."""
        return () if self.route is None else (self.route,)
