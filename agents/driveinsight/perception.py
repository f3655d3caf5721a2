"""The eyes of the policy, wired as in the paper's figure: encoders, fusion, memory, and heads.

    cameras -> CameraEncoder --+
                               +-> MultiModalFusion -> TemporalFusion -> BEV features -> heads
    LiDAR ---> LidarEncoder ---+             |                ^
                                             +-> MemoryBank --+

A moment is encoded by `encode`, from what is seen in it alone; `fuse` joins it with those that are
remembered. So training encodes each moment of a sequence once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from torch import Tensor, nn

from agents.driveinsight.camera import CameraEncoder
from agents.driveinsight.config import PolicyConfig
from agents.driveinsight.fusion import MultiModalFusion
from agents.driveinsight.heads import Heads, PerceptionHeads
from agents.driveinsight.lidar import LidarEncoder
from agents.driveinsight.memory import MemoryBank, TemporalFusion, empty_bank


@dataclass(frozen=True, kw_only=True)
class Encoded:
    """What sensors show at one moment, B samples at once.

    Attributes:
        features: (B, C, X, Y) of all sensors.
        remembered: (B, C', X, Y) what is to be remembered of them; None without a memory.
        depth: For each size of image (B, N, D, h, w) logits; empty without cameras.
        lamps: Features, fine and deep, of the camera that sees lamps best; None without cameras.
    """

    features: Tensor
    remembered: Tensor | None
    depth: tuple[Tensor, ...]
    lamps: tuple[Tensor, Tensor] | None


class Perception(nn.Module):
    """Sensors to BEV features and what they say."""

    def __init__(self, config: PolicyConfig) -> None:
        super().__init__()
        self.config = config
        camera, lidar, fusion = config.camera, config.lidar, config.fusion
        self.camera = CameraEncoder(camera, config.grid) if camera else None
        self.lidar = LidarEncoder(lidar, config.grid) if lidar else None
        channels = [part.channels for part in (camera, lidar) if part is not None]
        self.fusion = MultiModalFusion(channels, fusion.width)
        self.memory = TemporalFusion(
            fusion.width, fusion.remembered, config.memory_frames, fusion.widths, config.grid
        )
        lamps = None
        if camera is not None:
            expansion = {"basic": 1, "bottleneck": 4}[camera.block]
            lamps = (camera.width * expansion, camera.channels)
        self.heads = PerceptionHeads(fusion.widths[0], lamps)

    def encode(self, images: Sequence[Tensor], points: Tensor | None) -> Encoded:
        """What is seen at one moment.

        Args:
            images: For each size of image (B, N, 3, H, W), see `CameraEncoder`; empty without
                cameras.
            points: (B, P, 4); None without LiDAR.
        """
        maps = list[Tensor]()
        depth, lamps = (), None
        if self.camera is not None:
            seen, depth, lamps = self.camera(images)
            maps.append(seen)
        if self.lidar is not None:
            assert points is not None, "this policy has a LiDAR: give points"
            maps.append(self.lidar(points))
        features = self.fusion(maps)
        remembered = self.memory.remembered(features) if self.config.memory_frames else None
        return Encoded(features=features, remembered=remembered, depth=depth, lamps=lamps)

    def fuse(self, encoded: Encoded, pose: Tensor | None, bank: MemoryBank | None) -> Tensor:
        """(B, C, X, Y) BEV features, of what is seen now and what is remembered.

        Args:
            encoded: Of the present.
            pose: (B, 3) odometry; None without a memory.
            bank: What is remembered; None for nothing.
        """
        if bank is None and self.config.memory_frames:
            bank = self.empty_bank(len(encoded.features), like=encoded.features)
        bev: Tensor = self.memory(encoded.features, pose, bank)
        return bev

    def say(self, bev: Tensor, encoded: Encoded) -> Heads:
        """What BEV features and lamps say."""
        heads: Heads = self.heads(bev, encoded.lamps)
        return heads

    def empty_bank(self, batch: int, *, like: Tensor) -> MemoryBank:
        """A memory bank that remembers nothing."""
        config = self.config
        return empty_bank(
            batch, config.memory_frames, config.fusion.remembered, config.grid.cells, like=like
        )
