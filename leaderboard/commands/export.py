"""`driveinsight export`: collected drives as tar shards of pictures, for other people's models."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from leaderboard.commands.ending import EXIT_INTERRUPTED, UsageError, say
from leaderboard.commands.scene_arguments import says
from leaderboard.running.terminal import Terminal

if TYPE_CHECKING:
    from agents.training.export import ShardJob

EXPORT_HELP = """Write collected drives as tar shards of pictures, LiDAR, prompts and waypoints.

Examples:
  driveinsight export --data data --output shards
  driveinsight export --data data --output shards --cameras paper --images jpg --workers 2

Shards are named and laid out as webdataset reads them: KEY.camera_front.png, KEY.lidar.npy,
KEY.prompt.npz, KEY.waypoints.npy, KEY.json. docs/training.md says what is in each. A shard holds
whole drives, all their moments in order; after Ctrl-C the same command goes on."""


@dataclass(frozen=True, kw_only=True)
class Export:
    """The arguments of `driveinsight export`."""

    data: Annotated[Path, says("DIR", "data")] = Path("data")
    """Folder of drives."""

    output: Annotated[Path, says("DIR", "shards")] = Path("shards")
    """Folder for the shards."""

    cameras: Annotated[str, says("NAME", "small")] = "small"
    """Rig to render with: small, paper, rl; none for no pictures."""

    lidar: Annotated[str, says("NAME", "paper")] = "paper"
    """LiDAR to render with: paper, leaderboard, dense; none for no points."""

    images: Annotated[Literal["png", "jpg"], says("png|jpg", "png")] = "png"
    """Format of pictures: exact, or a tenth of the size."""

    drives_per_shard: Annotated[int, says("N", "4")] = 4
    """Drives in a shard."""

    workers: Annotated[int, says("N", "1")] = 1
    """Processes to render in; the files are the same for any number."""

    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Of the weather, which is drawn for each drive."""

    def run(self) -> int:
        """Exports; returns the exit code."""
        if self.drives_per_shard < 1 or self.workers < 1:
            raise UsageError("--drives-per-shard and --workers must be at least 1")

        from agents.training.export import ExportConfig, compile_for_shards, shard_jobs
        from agents.training.frames import DriveFileError
        from leaderboard.running.compiling import compile_progress

        try:
            config = ExportConfig(
                cameras=None if self.cameras == "none" else self.cameras,
                lidar=None if self.lidar == "none" else self.lidar,
                images=self.images,
                seed=self.seed,
            )
            jobs = shard_jobs(self.data, self.output, config, self.drives_per_shard)
            with compile_progress(Terminal(stderr=True)):
                compile_for_shards(jobs[0])
            written = self._export(jobs)
        except (ValueError, OSError, DriveFileError) as error:
            raise UsageError(str(error)) from error
        if written is None:
            say("Stopped; whole shards are kept.", "Next: the same command again goes on")
            return EXIT_INTERRUPTED
        say(
            f"Written: {len(jobs)} shards with {written} moments in {self.output}.",
            f"Next: read them, such as with webdataset.WebDataset({str(jobs[0].path)!r})",
        )
        return 0

    def _export(self, jobs: list[ShardJob]) -> int | None:
        """Renders; returns how many moments there are, None if asked to stop."""
        from agents.training.export import export
        from leaderboard.running.displays.work_bar import work_bar
        from leaderboard.running.interruption import interruptible

        moments = 0
        done = export(jobs, workers=self.workers)
        with (
            interruptible(ends_process=True) as interruption,
            work_bar("rendering", "shards") as bar,
            closing(done),
        ):
            task = bar.add_task("", total=len(jobs))
            for outcome in done:
                moments += outcome
                bar.update(task, advance=1, description=f"{moments} moments")
                if interruption.requested:
                    return None
        return moments
