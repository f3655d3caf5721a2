"""Sequences rendered from drives: what the sensors show at some moments, and what truly is there.

All that varies is drawn from a sequence's key: the weather, and how far the ego is set aside from
where it drove, the same at all its moments.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from agents.driveinsight.camera import depths_of, image_groups
from agents.driveinsight.config import PolicyConfig
from agents.driveinsight.perception_losses import PerceptionTargets
from agents.driveinsight.seen import OBJECT_COLUMNS, SIGNAL_COLUMNS
from agents.training.bev_teacher import bev_semantics
from agents.training.frames import DriveStage, RecordedDrive
from agents.training.truth import hidden_cells, seen_truth, shown_lamps
from agents.training.variation import Variation, drawn
from di_envs.observer import Observer
from di_envs.sensors.camera.config import CameraConfig, Rig, rig_of
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.state import Capacity

LAMP_STRIDE = 4  # pixels of an image to one of the map of lamps


@dataclass(frozen=True, kw_only=True)
class Moments:
    """B sequences of T moments, those of a sequence one after the other.

    Attributes:
        images: For each size of image (B*T, N, 3, H, W) uint8; empty without cameras.
        points: (B*T, P, 4); None without LiDAR.
        poses: (B*T, 3) x, y [m], yaw [rad] of the ego, in a frame of each sequence's own.
        targets: What is there at each.
    """

    images: tuple[Tensor, ...]
    points: Tensor | None
    poses: Tensor
    targets: PerceptionTargets


class SequenceRenderer:
    """Renders sequences of one town with one policy's sensors.

    Args:
        config: The policy.
        town: Where.
        plan_of: Plans its routes by their ids.
        depth: Whether depths of pixels are wanted as targets.
    """

    def __init__(
        self, config: PolicyConfig, town: Town, plan_of: Callable[[str], RoutePlan], *, depth: bool
    ) -> None:
        self.config, self._town, self._depth = config, town, depth
        # A stage needs a plan, but no sensor shows it: so any will do, and one stage for all drives
        self._plan_of = plan_of
        self._plan: RoutePlan | None = None
        rig = None if config.camera is None else rig_of(config.camera.rig)
        self._rig = None if rig is None else replace(rig, depth=depth)
        self._groups = () if rig is None else image_groups(rig)
        self._stages = functools.lru_cache(4)(self._stage)

    def sequence(
        self, drive: RecordedDrive, last: int, length: int, variation: Variation, key: int
    ) -> Moments:
        """The moments that end at `last`, or the first ones where there are fewer before it.

        Args:
            drive: In this town.
            last: The newest moment.
            length: How many moments.
            variation: How it is varied.
            key: Of all draws: equal keys give equal sequences.
        """
        right_m, turn_rad, weather = drawn(variation, key)
        if self._plan is None:
            self._plan = self._plan_of(str(drive.facts["route_id"]))
        stage, observer = self._stages(drive.capacity)
        observer.change_weather(weather)
        first = max(last - length + 1, 0)
        moments, origin = [], drive.poses()[first, :2]
        for moment in range(first, first + length):
            stage.set(drive, moment, right_m=right_m, turn_rad=turn_rad)
            moments.append(self._moment(stage, observer.observe(), origin))
        return joined(moments)

    def _stage(self, capacity: Capacity) -> tuple[DriveStage, Observer]:
        config = self.config
        observer = Observer(
            self._town,
            tuple(group for group in config.observations if group in ("camera", "lidar")),
            cameras=self._rig or "small",
            lidar=config.lidar.lidar if config.lidar else "paper",
        )
        assert self._plan is not None
        stage = DriveStage(self._town, self._plan, capacity)
        observer.start(stage.view)  # once: its kernels are looked up in it, which takes a while
        return stage, observer

    def _moment(
        self, stage: DriveStage, shown: Mapping[str, Any], origin: NDArray[np.float64]
    ) -> Moments:
        """What is shown and what is there; poses are told from an origin (2,), world frame."""
        view, grid = stage.view, self.config.grid
        objects, signals = seen_truth(view, grid)
        semantics = bev_semantics(view, grid)
        hidden_cells(objects, grid, semantics)
        lamps = None
        if self._rig is not None:
            camera = sharpest(self._rig)
            lamps = torch.from_numpy(shown_lamps(view, camera, LAMP_STRIDE))[None]
        state = view.state
        pose = np.array([state.x[0] - origin[0], state.y[0] - origin[1], state.yaw[0]], np.float32)
        signal = signals[:1] if len(signals) else np.zeros((1, SIGNAL_COLUMNS), np.float32)
        return Moments(
            images=tuple(
                torch.from_numpy(np.stack([shown[c.name] for c in group])).permute(0, 3, 1, 2)[None]
                for group in self._groups
            ),
            points=torch.from_numpy(shown["lidar"])[None] if self.config.lidar else None,
            poses=torch.from_numpy(pose)[None],
            targets=PerceptionTargets(
                semantics=torch.from_numpy(semantics)[None],
                objects=torch.from_numpy(objects)[None],
                signal=torch.from_numpy(signal),
                lamps=lamps,
                depth=tuple(self._bins(group, shown) for group in self._groups if self._depth),
            ),
        )

    def _bins(self, group: Sequence[CameraConfig], shown: Mapping[str, Any]) -> Tensor:
        """(1, N, h, w) the depth bin at the centre of each feature pixel; -1 out of range."""
        camera = self.config.camera
        assert camera is not None
        depths = depths_of(camera)
        between = 0.5 * (depths[1:] + depths[:-1])
        images = [shown[f"{each.name}_depth"] for each in group]
        rows, columns = (_feature_centres(size, camera.stride) for size in images[0].shape)
        centres = np.stack([image[np.ix_(rows, columns)] for image in images])
        bins = np.searchsorted(between, centres).astype(np.int8)
        near_enough = centres < depths[-1] + (depths[-1] - between[-1])
        return torch.from_numpy(np.where(near_enough, bins, np.int8(-1)))[None]


def sharpest(rig: Rig) -> CameraConfig:
    """The first camera of those in which a lamp is largest."""
    return max((group[0] for group in image_groups(rig)), key=lambda camera: camera.focal_px)


def _feature_centres(size: int, stride: int) -> NDArray[np.int64]:
    """The pixels in the middle of feature pixels; the last of these may reach over the edge."""
    return np.minimum(np.arange(0, size, stride) + stride // 2, size - 1)


def joined(parts: Sequence[Moments]) -> Moments:
    """Moments of several, one after the other."""
    first = parts[0]
    most = max(part.targets.objects.shape[1] for part in parts)
    return Moments(
        images=tuple(torch.cat(group) for group in zip(*(p.images for p in parts), strict=True)),
        points=None if first.points is None else torch.cat([_given(p.points) for p in parts]),
        poses=torch.cat([part.poses for part in parts]),
        targets=PerceptionTargets(
            semantics=torch.cat([part.targets.semantics for part in parts]),
            objects=torch.cat([_padded(part.targets.objects, most) for part in parts]),
            signal=torch.cat([part.targets.signal for part in parts]),
            lamps=(
                None
                if first.targets.lamps is None
                else torch.cat([_given(part.targets.lamps) for part in parts])
            ),
            depth=tuple(
                torch.cat(group) for group in zip(*(p.targets.depth for p in parts), strict=True)
            ),
        ),
    )


def _given(part: Tensor | None) -> Tensor:
    assert part is not None, "moments of one policy have the same sensors"
    return part


def _padded(objects: Tensor, rows: int) -> Tensor:
    """(B, M, 9) with so many rows."""
    out = objects.new_zeros(len(objects), rows, OBJECT_COLUMNS)
    out[:, : objects.shape[1]] = objects
    return out
