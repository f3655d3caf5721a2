"""`driveinsight drive`: drives one route while somebody watches."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from leaderboard.commands.ending import EXIT_CRASHED, UsageError, say
from leaderboard.commands.scene_arguments import SceneArguments, says
from leaderboard.running.terminal import Terminal

DRIVE_HELP = """Drive one route and watch: its events, its score, and a video if wanted.

Examples:
  driveinsight drive --agent expert --suite town05_long --route 3
  driveinsight drive --agent expert --suite town05_long --route 3 --video out.mp4
  driveinsight drive --agent path/to/mine.py:MyAgent --suite town05_tiny --video out.gif
  driveinsight drive --agent path/to/mine.py:MyAgent --suite town05_tiny \\
      --intervene "recolour:lights=red@t>5"

The drive is the one that `evaluate` scores for this route and seed, bit for bit."""


@dataclass(frozen=True, kw_only=True)
class Drive(SceneArguments):
    """The arguments of `driveinsight drive`."""

    route: Annotated[str | None, says("ID", "the first")] = None
    """Id of the route to drive."""

    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Which seed's world to drive in."""

    video: Annotated[Path | None, says("FILE", "none")] = None
    """Write a video: .mp4, .mkv, .mov, or .gif."""

    no_camera: tyro.conf.FlagCreatePairsOff[bool] = False
    """Leave the front camera out of the video."""

    def run(self) -> int:
        """Drives; returns the exit code."""
        options, _ = self.choose(() if self.route is None else (self.route,))

        from leaderboard.running.drive import drive, record_lines
        from leaderboard.running.jobs import RunSpec, SetupError
        from leaderboard.running.video import VideoError, check_video, video_facts

        spec = RunSpec(
            agent=self.agent,
            options=options,
            rules=self.rules,
            interventions=self.edits(),
            isolate=not self.no_isolate,
        )
        before = self._filmed_ns()
        try:
            if self.video is not None:
                check_video(self.video)
            record = drive(
                spec,
                route_id=self.route,
                seed=self.seed,
                console=Terminal(stderr=True),
                video=self.video,
                camera=not self.no_camera,
            )
        except (SetupError, VideoError) as error:
            raise UsageError(str(error)) from error
        say(*record_lines(record))
        if self.video is not None:
            filmed = self._filmed_ns() not in (None, before)
            if filmed:
                say(f"Written: {self.video} ({video_facts(self.video)})")
            else:
                say(f"Nothing was filmed: no {self.video}")
        return EXIT_CRASHED if record.lost else 0

    def _filmed_ns(self) -> int | None:
        """When the video's file was written; None if there is none."""
        there = self.video is not None and self.video.is_file()
        return self.video.stat().st_mtime_ns if self.video is not None and there else None
