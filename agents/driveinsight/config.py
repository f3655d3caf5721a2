"""What a policy is built from: every size and rate of the network, as frozen values.

A configuration is saved beside the weights, and weights are loaded into no other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Self

from di_envs.config import check_name
from di_envs.files.json_values import from_json, to_json
from di_envs.prompt import COMPONENTS
from di_envs.sensors.camera.config import rig_of

FORMAT_VERSION = 1  # of configurations and weights; a change of the network raises it

BEV = "bev"  # the component that is no prompt: the features of cameras and LiDAR
TOKENS = (*COMPONENTS, BEV)

# How often training hides a component, fixed before any ablation of a shipped policy was run. What
# tells the way is hidden least, as hiding it leaves the target undefined; what cameras show too is
# hidden more. Two samples in five are seen whole: so one sees how to drive with all that there is.
DROPOUT: Mapping[str, float] = MappingProxyType(
    {
        "command": 0.075,
        "target_point": 0.05,
        "routing": 0.05,
        "map": 0.1,
        "obstacles": 0.1,
        "traffic_lights": 0.1,
        "stop_signs": 0.1,
        "speed": 0.1,
        "speed_history": 0.15,
        BEV: 0.05,
    }
)


LARGEST = 4096  # of any number that sizes a network: more is a slip, and would take all memory


def check_sizes(config: Any, *names: str) -> None:
    """Refuses sizes of which no network is made.

    Raises:
        ValueError: Names the first that is not from 1 to `LARGEST`.
    """
    for name in names:
        value = getattr(config, name)
        for size in value if isinstance(value, tuple | list) else (value,):
            if not 1 <= size <= LARGEST:
                raise ValueError(f"{name} must be from 1 to {LARGEST}, not {size}")


@dataclass(frozen=True, kw_only=True)
class GridConfig:
    """The space around the ego that features are gathered in, ego frame [m].

    Source: the paper's point cloud range.
    """

    x_min_m: float = -8.0
    x_max_m: float = 30.4
    y_min_m: float = -19.2
    y_max_m: float = 19.2
    z_min_m: float = -4.0
    z_max_m: float = 10.0
    cells: int = 48  # along x and along y

    def __post_init__(self) -> None:
        check_sizes(self, "cells")
        for axis in "xyz":
            low, high = getattr(self, f"{axis}_min_m"), getattr(self, f"{axis}_max_m")
            if not low < high:
                raise ValueError(f"the grid needs {axis}_min_m < {axis}_max_m, not {low}, {high}")
        if self.cells < 8 or self.cells % 8:
            raise ValueError(f"the grid needs a multiple of 8 cells, not {self.cells}")

    @property
    def cell_x_m(self) -> float:
        """Side of a cell along x."""
        return (self.x_max_m - self.x_min_m) / self.cells

    @property
    def cell_y_m(self) -> float:
        """Side of a cell along y."""
        return (self.y_max_m - self.y_min_m) / self.cells


@dataclass(frozen=True, kw_only=True)
class CameraEncoderConfig:
    """Images to BEV features.

    Attributes:
        rig: Name of the shipped rig whose images it takes.
        block: `basic` or `bottleneck`, of the ResNet.
        depths: Blocks of each of its four layers.
        width: Channels of its stem.
        stride: Of the feature map that is lifted: 4, 8 or 16 pixels.
        channels: Of features and of their BEV.
        depth_bins: Distances that a pixel may lie at.
        nearest_m: The first of them, ahead of the camera's plane.
        farthest_m: The last.
    """

    rig: str = "small"
    block: str = "basic"
    depths: tuple[int, int, int, int] = (1, 1, 1, 1)
    width: int = 16
    stride: int = 4
    channels: int = 32
    depth_bins: int = 24
    nearest_m: float = 2.0
    farthest_m: float = 40.0

    def __post_init__(self) -> None:
        rig_of(self.rig)
        check_sizes(self, "depths", "width", "channels", "depth_bins")
        check_name(self.block, ("basic", "bottleneck"), "ResNet block")
        object.__setattr__(self, "depths", tuple(self.depths))
        if self.stride not in (4, 8, 16):
            raise ValueError(f"features are lifted at stride 4, 8 or 16, not {self.stride}")
        if not 0.0 < self.nearest_m < self.farthest_m:
            raise ValueError(
                f"depths need 0 < nearest_m < farthest_m, not {self.nearest_m}, {self.farthest_m}"
            )


@dataclass(frozen=True, kw_only=True)
class LidarEncoderConfig:
    """Points to BEV features.

    Attributes:
        lidar: Name of the shipped LiDAR whose points it takes.
        voxel_m: Side of a voxel along x and y; its cells must halve evenly down to the grid's.
        voxel_z_m: … along z.
        widths: Channels of each sparse level; each level but the first halves the voxels.
        channels: Of the BEV features.
    """

    lidar: str = "paper"
    voxel_m: float = 0.4
    voxel_z_m: float = 1.0
    widths: tuple[int, ...] = (16, 32)
    channels: int = 32

    def __post_init__(self) -> None:
        object.__setattr__(self, "widths", tuple(self.widths))
        check_sizes(self, "widths", "channels")
        if not self.widths:
            raise ValueError("widths needs a level")
        for name in ("voxel_m", "voxel_z_m"):
            if getattr(self, name) < 0.05:
                raise ValueError(f"{name} must be 0.05 or more, not {getattr(self, name):g}")


@dataclass(frozen=True, kw_only=True)
class PlannerConfig:
    """Tokens to waypoints.

    Attributes:
        width: Of a token.
        heads: Of the cross-attention.
        layers: Of the decoder.
        bev_tokens: Along x and along y.
        waypoints: Number of them.
        waypoint_dt_s: Time between them.
        dropout: How often training hides each component; see `DROPOUT`.
    """

    width: int = 96
    heads: int = 6
    layers: int = 3
    bev_tokens: int = 12
    waypoints: int = 8
    waypoint_dt_s: float = 0.5
    dropout: Mapping[str, float] = field(default_factory=lambda: DROPOUT)

    def __post_init__(self) -> None:
        check_sizes(self, "width", "heads", "layers", "bev_tokens", "waypoints")
        if not self.waypoint_dt_s > 0.0:
            raise ValueError(f"waypoint_dt_s must be positive, not {self.waypoint_dt_s:g}")
        if self.width % self.heads:
            raise ValueError(f"{self.heads} heads do not share a width of {self.width} evenly")
        object.__setattr__(self, "dropout", MappingProxyType(dict(self.dropout)))
        for name, rate in self.dropout.items():
            check_name(name, TOKENS, "component in dropout")
            if not 0.0 <= rate < 1.0:
                raise ValueError(f"the dropout of {name} must be in [0, 1), not {rate}")


@dataclass(frozen=True, kw_only=True)
class PolicyConfig:
    """A whole policy.

    Attributes:
        name: What model cards and errors call it.
        camera: None for a policy without cameras.
        lidar: None for a policy without LiDAR.
        prompt: Components that it is given; the others are always hidden.
        memory_frames: Past BEV features that are remembered; 0 for none.
        memory_dt_s: Time between two of them.
        bev_width: Channels of the fused BEV features.
    """

    name: str
    grid: GridConfig = field(default_factory=GridConfig)
    camera: CameraEncoderConfig | None = field(default_factory=CameraEncoderConfig)
    lidar: LidarEncoderConfig | None = field(default_factory=LidarEncoderConfig)
    planner: PlannerConfig = field(default_factory=PlannerConfig)
    prompt: tuple[str, ...] = COMPONENTS
    memory_frames: int = 2
    memory_dt_s: float = 0.5
    bev_width: int = 32

    def __post_init__(self) -> None:
        object.__setattr__(self, "prompt", tuple(self.prompt))
        for name in self.prompt:
            check_name(name, COMPONENTS, "prompt component")
        check_sizes(self, "bev_width")
        if not 0 <= self.memory_frames <= LARGEST:
            raise ValueError(f"memory_frames must be from 0 to {LARGEST}, not {self.memory_frames}")
        if not self.memory_dt_s > 0.0:
            raise ValueError(f"memory_dt_s must be positive, not {self.memory_dt_s:g}")
        if not self.sensors and not self.prompt:
            raise ValueError("a policy needs a camera, a LiDAR or a prompt component")

    @property
    def sensors(self) -> bool:
        """Whether it sees anything itself: only then are there BEV features."""
        return self.camera is not None or self.lidar is not None

    @property
    def observations(self) -> tuple[str, ...]:
        """Groups of observations that it reads."""
        groups = ["camera"] * (self.camera is not None) + ["lidar"] * (self.lidar is not None)
        memory = ["odometry"] * (self.sensors and self.memory_frames > 0)
        return (*groups, "prompt", *memory)

    def to_mapping(self) -> dict[str, Any]:
        """As values that JSON has."""
        values: dict[str, Any] = to_json(self)
        return values

    @classmethod
    def from_mapping(cls, values: Any, source: str = "policy configuration") -> Self:
        """The inverse of `to_mapping`.

        Args:
            values: JSON values.
            source: What errors call the file.

        Raises:
            JsonError: If a field is unknown, missing or of another type, or a value is refused.
        """
        return from_json(cls, values, source)


_NO_PRIVILEGE = ("command", "target_point", "routing", "speed", "speed_history")

CONFIGS: Mapping[str, PolicyConfig] = MappingProxyType(
    {
        config.name: config
        for config in (
            PolicyConfig(name="small"),
            PolicyConfig(name="small-without-cameras", camera=None),
            PolicyConfig(name="small-without-lidar", lidar=None),
            PolicyConfig(name="small-prompt-only", camera=None, lidar=None, memory_frames=0),
            PolicyConfig(name="small-without-privilege", prompt=_NO_PRIVILEGE),
            PolicyConfig(
                name="tiny",
                grid=GridConfig(cells=24),
                camera=CameraEncoderConfig(rig="rl", width=8, channels=16, depth_bins=12),
                lidar=None,
                planner=PlannerConfig(
                    width=64,
                    heads=4,
                    layers=2,
                    bev_tokens=6,
                    # minutes of training, for driving with all that there is: nothing is hidden
                    dropout={},
                ),
                memory_frames=0,
                bev_width=16,
            ),
            PolicyConfig(
                name="paper",
                grid=GridConfig(cells=96),
                camera=CameraEncoderConfig(
                    rig="paper",
                    block="bottleneck",
                    depths=(3, 4, 6, 3),
                    width=64,
                    stride=16,
                    channels=128,
                    depth_bins=40,
                ),
                lidar=LidarEncoderConfig(voxel_m=0.2, voxel_z_m=0.5, widths=(16, 32), channels=128),
                planner=PlannerConfig(width=256, heads=8, layers=6, bev_tokens=24),
                bev_width=128,
            ),
        )
    }
)


def config_named(name: str) -> PolicyConfig:
    """The configuration of that name.

    Raises:
        ValueError: If there is none; suggests the nearest.
    """
    check_name(name, CONFIGS, "policy configuration")
    return CONFIGS[name]
