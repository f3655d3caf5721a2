"""Collected drives as tar shards of pictures, points, prompts and waypoints, for any model.

Laid out as webdataset reads them: the files of one sample follow each other and share a key. What
is in a shard is a function of its drives and of the seed: the same bytes from any process.
"""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from agents.processes import in_order, processes
from agents.training.data_card import drive_paths
from agents.training.frames import (
    FRAME_S,
    DriveFileError,
    DriveStage,
    RecordedDrive,
    read_drive,
)
from agents.training.towns import training_plan, training_town
from agents.training.variation import FOURTEEN_WEATHERS
from agents.training.waypoints import expert_waypoints
from di_envs.config import check_name
from di_envs.files.whole import write_whole
from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.observer import Observer
from di_envs.prompt import COMPONENTS
from di_envs.sensors.camera.config import rig_of
from di_envs.sensors.lidar.config import lidar_of
from di_envs.town.plan import RoadOption
from di_envs.world.state import Capacity

WAYPOINTS = 8
JPG_QUALITY = 90


@dataclass(frozen=True, kw_only=True)
class ExportConfig:
    """What is rendered.

    Attributes:
        cameras: Name of the rig; None for no pictures.
        lidar: Name of the LiDAR; None for no points.
        images: `png` or `jpg`.
        seed: Of the weather, which is drawn for each drive.
    """

    cameras: str | None = "small"
    lidar: str | None = "paper"
    images: str = "png"
    seed: int = 0

    def __post_init__(self) -> None:
        check_name(self.images, ("png", "jpg"), "format of images")
        if self.cameras is not None:
            rig_of(self.cameras)
        if self.lidar is not None:
            lidar_of(self.lidar)

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups of observations that are looked at."""
        sensors = ["camera"] * (self.cameras is not None) + ["lidar"] * (self.lidar is not None)
        return (*sensors, "prompt")


@dataclass(frozen=True, kw_only=True)
class ShardJob:
    """One shard: where it comes to be, and the drives that it holds."""

    path: Path
    drives: tuple[Path, ...]
    config: ExportConfig


def shard_jobs(
    data: Path, output: Path, config: ExportConfig, drives_per_shard: int
) -> list[ShardJob]:
    """The shards of a folder of drives.

    Raises:
        DriveFileError: If there are no drives.
    """
    paths = drive_paths(data)
    if not paths:
        raise DriveFileError(f"there are no drives in {data}: run `driveinsight collect` first")
    return [
        ShardJob(
            path=output / f"driveinsight-{number:06d}.tar",
            drives=tuple(paths[first : first + drives_per_shard]),
            config=config,
        )
        for number, first in enumerate(range(0, len(paths), drives_per_shard))
    ]


def export(jobs: list[ShardJob], *, workers: int = 1) -> Generator[int, None, None]:
    """Writes the shards that are not there yet; yields the moments of each.

    Raises:
        DriveFileError: If a drive is not whole.
        ChildProcessError: If a process died.
    """
    with processes(workers) as pool:
        yield from in_order(pool, write_shard, jobs, ahead=2 * workers)


def compile_for_shards(job: ShardJob) -> None:
    """Renders one sample, so that all kernels are compiled."""
    next(_samples(read_drive(job.drives[0]), job.config))


def write_shard(job: ShardJob) -> int:
    """Renders a shard, unless it is there; returns its number of moments."""
    drives = [read_drive(path) for path in job.drives]
    if not job.path.exists():
        write_whole(job.path, lambda file: _write(file, drives, job.config))
    return sum(len(drive) for drive in drives)


def _write(file: Any, drives: list[RecordedDrive], config: ExportConfig) -> None:
    with tarfile.open(fileobj=file, mode="w", format=tarfile.USTAR_FORMAT) as tar:
        for drive in drives:
            for key, parts in _samples(drive, config):
                for name, content in parts.items():
                    entry = tarfile.TarInfo(f"{key}.{name}")  # dated 1970: the same bytes again
                    entry.size = len(content)
                    tar.addfile(entry, io.BytesIO(content))


def _samples(drive: RecordedDrive, config: ExportConfig) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Key and files of each moment."""
    facts = drive.facts
    town, route = str(facts["town"]), str(facts["route_id"])
    draw = float(uniform(config.seed, int(Stream.AGENT), int(facts["number"]), 4))
    weather = FOURTEEN_WEATHERS[int(draw * len(FOURTEEN_WEATHERS))]
    stage, observer = _stage(town, route, drive.capacity, config)
    observer.change_weather(weather)
    for moment in range(len(drive)):
        stage.set(drive, moment)
        observation = observer.observe()
        waypoints, valid = expert_waypoints(drive, moment, WAYPOINTS, drive.poses()[moment])
        about = {
            "town": town,
            "route": route,
            "drive": facts["number"],
            "moment": moment,
            "time_s": round(moment * FRAME_S, 3),
            "weather": weather,
            "command": RoadOption(int(observation["command"])).name.lower(),
            "speed_mps": float(drive.speeds()[moment]),
            "control": [float(value) for value in drive.controls[moment]],
            "waypoints_valid": int(valid.sum()),
        }
        key = f"{town}-{facts['number']:05d}-{moment:05d}"
        yield key, _files(observation, waypoints, about, config)


@lru_cache(64)
def _stage(
    town: str, route_id: str, capacity: Capacity, config: ExportConfig
) -> tuple[DriveStage, Observer]:
    loaded = training_town(town)
    observer = Observer(
        loaded,
        config.groups,
        cameras=config.cameras or "small",
        lidar=config.lidar or "paper",
    )
    stage = DriveStage(loaded, training_plan(town, route_id), capacity)
    observer.start(stage.view)
    return stage, observer


def _files(
    observation: Mapping[str, Any],
    waypoints: NDArray[np.float32],
    about: Mapping[str, Any],
    config: ExportConfig,
) -> dict[str, bytes]:
    """The files of one sample by what stands behind its key."""
    files: dict[str, bytes] = {}
    if config.cameras is not None:
        for camera in rig_of(config.cameras).cameras:
            picture = _picture(observation[camera.name], config.images)
            files[f"{camera.name}.{config.images}"] = picture
    if config.lidar is not None:
        files["lidar.npy"] = _array(observation["lidar"])
    prompt = io.BytesIO()
    np.savez_compressed(prompt, **{name: observation[name] for name in COMPONENTS})
    files["prompt.npz"] = prompt.getvalue()
    files["waypoints.npy"] = _array(waypoints)
    files["json"] = (json.dumps(about) + "\n").encode()
    return files


def _picture(image: NDArray[np.uint8], kind: str) -> bytes:
    file = io.BytesIO()
    if kind == "png":
        Image.fromarray(image).save(file, "PNG", compress_level=1)
    else:
        Image.fromarray(image).save(file, "JPEG", quality=JPG_QUALITY)
    return file.getvalue()


def _array(values: NDArray[Any]) -> bytes:
    file = io.BytesIO()
    np.save(file, values)
    return file.getvalue()
