"""What a policy is built from: every size and rate of the network, as frozen values.

A configuration is saved beside the weights, and weights are loaded into no other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from typing_extensions import Self

from agents.networks.grid import WIDE_GRID, GridConfig
from agents.networks.sizes import LARGEST, check_sizes
from di_envs.config import check_name
from di_envs.files.json_values import from_json, to_json
from di_envs.prompt import COMPONENTS
from di_envs.sensors.camera.config import rig_of

FORMAT_VERSION = 2  # of configurations and weights; a change of the network raises it

BEV = "bev"  # the component that is no prompt: the features of cameras and LiDAR
TOKENS = (*COMPONENTS, BEV)

# How often training hides a component by itself, fixed before any ablation of a shipped policy was
# run. What tells the way is hidden least, as hiding it leaves the target undefined; speeds are
# hidden most, as a driver that knows them copies them instead of looking where it goes.
DROPOUT: Mapping[str, float] = MappingProxyType(
    {
        "command": 0.075,
        "target_point": 0.05,
        "routing": 0.05,
        "map": 0.1,
        "obstacles": 0.1,
        "traffic_lights": 0.1,
        "stop_signs": 0.1,
        "speed": 0.25,
        "speed_history": 0.5,
        BEV: 0.2,
    }
)
# ... and some together: what a policy that is told nothing of the world must do without. The second
# came later, since a policy without it stood for ever before lights that it was told are green: one
# sample in a hundred was told of lights while it neither saw nor was told of anybody.
# Of obstacles x bev: .2 of samples lack both, .35 obstacles alone, .08 bev alone.
TOGETHER: Mapping[str, float] = MappingProxyType(
    {"map+obstacles+traffic_lights+stop_signs": 0.5, "obstacles+bev": 0.1}
)


@dataclass(frozen=True, kw_only=True)
class CameraEncoderConfig:
    """Images to BEV features; images of each size have a backbone of their own.

    Attributes:
        rig: Name of the shipped rig whose images it takes.
        block: `basic` or `bottleneck`, of the ResNet.
        depths: Blocks of each of its layers, which are at strides 4, 8, 16 and 32.
        width: Channels of its stem.
        stride: Of the feature map that is lifted: 4, 8 or 16 pixels.
        channels: Of features and of their BEV.
        depth_bins: Distances that a pixel may lie at, denser the nearer they are.
        nearest_m: The first of them, ahead of the camera's plane.
        farthest_m: The last.
    """

    rig: str = "driveinsight"
    block: str = "basic"
    depths: tuple[int, ...] = (1, 1, 1)
    width: int = 16
    stride: int = 8
    channels: int = 32
    depth_bins: int = 32
    nearest_m: float = 2.0
    farthest_m: float = 64.0

    def __post_init__(self) -> None:
        rig_of(self.rig)
        check_sizes(self, "depths", "width", "channels", "depth_bins")
        check_name(self.block, ("basic", "bottleneck"), "ResNet block")
        object.__setattr__(self, "depths", tuple(self.depths))
        strides = tuple(4 * 2**n for n in range(len(self.depths)))
        if not 1 <= len(self.depths) <= 4:
            raise ValueError(f"a ResNet has 1 to 4 layers, not {len(self.depths)}")
        if self.stride not in strides[:3]:
            raise ValueError(f"features are lifted at stride {strides[:3]}, not {self.stride}")
        if not 0.0 < self.nearest_m < self.farthest_m:
            raise ValueError(
                f"depths need 0 < nearest_m < farthest_m, not {self.nearest_m}, {self.farthest_m}"
            )


@dataclass(frozen=True, kw_only=True)
class LidarEncoderConfig:
    """Points to BEV features.

    Attributes:
        lidar: Name of the shipped LiDAR whose points it takes.
        heights_m: Edges of the slices that points are counted in, above the ground.
        channels: Of the BEV features.
    """

    lidar: str = "paper"
    heights_m: tuple[float, ...] = (-1.0, 0.2, 0.6, 1.0, 1.4, 1.9, 2.6, 4.0)
    channels: int = 32

    def __post_init__(self) -> None:
        object.__setattr__(self, "heights_m", tuple(self.heights_m))
        if len(self.heights_m) < 2 or list(self.heights_m) != sorted(set(self.heights_m)):
            raise ValueError(f"heights_m must be two or more that rise, not {self.heights_m}")
        check_sizes(self, "channels")


@dataclass(frozen=True, kw_only=True)
class FusionConfig:
    """BEV features of the sensors, and remembered ones, to those that heads and planner read.

    Attributes:
        width: Channels of the features of one moment.
        remembered: Channels of what is remembered of it.
        widths: Channels of the U-Net over the present and the past, the finest map first; the
            features that come out have as many as that.
    """

    width: int = 32
    remembered: int = 16
    widths: tuple[int, ...] = (32, 48, 64, 96)

    def __post_init__(self) -> None:
        object.__setattr__(self, "widths", tuple(self.widths))
        check_sizes(self, "widths", "width", "remembered")
        if not self.widths:
            raise ValueError("widths needs a level")


@dataclass(frozen=True, kw_only=True)
class PlannerConfig:
    """Tokens to waypoints.

    Attributes:
        width: Of a token.
        heads: Of attention.
        layers: Of the decoder, in which queries look at tokens.
        mixing_layers: In which tokens look at each other, before it.
        each_row: A token for each obstacle and signal, instead of one for all of them.
        next_row: One more token for the obstacle, and the signal, that comes next along the route.
        each_waypoint: A query for each waypoint, instead of one for the ego.
        waypoints: Number of them.
        waypoint_dt_s: Time between them.
        dropout: How often training hides each component by itself; see `DROPOUT`.
        together: Names of components, joined by '+', to how often all of them are hidden together.
    """

    width: int = 96
    heads: int = 6
    layers: int = 3
    mixing_layers: int = 0
    each_row: bool = False
    next_row: bool = False
    each_waypoint: bool = False
    waypoints: int = 8
    waypoint_dt_s: float = 0.5
    dropout: Mapping[str, float] = field(default_factory=lambda: DROPOUT)
    together: Mapping[str, float] = field(default_factory=lambda: TOGETHER)

    def __post_init__(self) -> None:
        check_sizes(self, "width", "heads", "layers", "waypoints")
        if not 0 <= self.mixing_layers <= LARGEST:
            raise ValueError(f"mixing_layers must be from 0 to {LARGEST}, not {self.mixing_layers}")
        if not self.waypoint_dt_s > 0.0:
            raise ValueError(f"waypoint_dt_s must be positive, not {self.waypoint_dt_s:g}")
        if self.width % self.heads:
            raise ValueError(f"{self.heads} heads do not share a width of {self.width} evenly")
        object.__setattr__(self, "dropout", MappingProxyType(dict(self.dropout)))
        object.__setattr__(self, "together", MappingProxyType(dict(self.together)))
        for names, rate in (*self.dropout.items(), *self.together.items()):
            for name in names.split("+"):
                check_name(name, TOKENS, "component in dropout")
            if not 0.0 <= rate < 1.0:
                raise ValueError(f"the dropout of {names} must be in [0, 1), not {rate}")


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
        fusion: Of what the sensors see, and of what is remembered.
    """

    name: str
    grid: GridConfig = WIDE_GRID
    camera: CameraEncoderConfig | None = field(default_factory=CameraEncoderConfig)
    lidar: LidarEncoderConfig | None = field(default_factory=LidarEncoderConfig)
    planner: PlannerConfig = field(default_factory=PlannerConfig)
    prompt: tuple[str, ...] = COMPONENTS
    memory_frames: int = 2
    memory_dt_s: float = 0.5
    fusion: FusionConfig = field(default_factory=FusionConfig)

    def __post_init__(self) -> None:
        object.__setattr__(self, "prompt", tuple(self.prompt))
        for name in self.prompt:
            check_name(name, COMPONENTS, "prompt component")
        if not 0 <= self.memory_frames <= LARGEST:
            raise ValueError(f"memory_frames must be from 0 to {LARGEST}, not {self.memory_frames}")
        if not self.memory_dt_s > 0.0:
            raise ValueError(f"memory_dt_s must be positive, not {self.memory_dt_s:g}")
        if not self.sensors and not self.prompt:
            raise ValueError("a policy needs a camera, a LiDAR or a prompt component")

    @property
    def bev_width(self) -> int:
        """Channels of the BEV features that heads and planner read."""
        return self.fusion.widths[0]

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


_WAY = ("command", "target_point", "routing", "speed", "speed_history")  # and how it moves along it
# nothing else shows the world
_SEEING = PlannerConfig(next_row=True, dropout={**DROPOUT, BEV: 0.1}, together={})
# without sensors there is nothing to make up for what is hidden
_TOLD = PlannerConfig(next_row=True, together={})

CONFIGS: Mapping[str, PolicyConfig] = MappingProxyType(
    {
        config.name: config
        for config in (
            PolicyConfig(name="driveinsight", planner=PlannerConfig(next_row=True)),
            PolicyConfig(
                name="driveinsight-told", camera=None, lidar=None, memory_frames=0, planner=_TOLD
            ),
            PolicyConfig(name="driveinsight-sensors", prompt=_WAY, planner=_SEEING),
            PolicyConfig(
                name="route-only",
                camera=None,
                lidar=None,
                memory_frames=0,
                prompt=_WAY,
                planner=_TOLD,
            ),
            PolicyConfig(
                name="tiny",
                grid=GridConfig(cells=24),
                camera=CameraEncoderConfig(rig="rl", width=8, channels=16, depth_bins=12),
                fusion=FusionConfig(width=16, remembered=8, widths=(16, 24, 32)),
                lidar=None,
                planner=PlannerConfig(
                    width=64,
                    heads=4,
                    layers=2,
                    # minutes of training, for driving with all that there is: nothing is hidden
                    dropout={},
                    together={},
                ),
                memory_frames=0,
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
                lidar=LidarEncoderConfig(channels=128),
                fusion=FusionConfig(width=128, remembered=128, widths=(128, 128, 256, 256)),
                planner=PlannerConfig(width=256, heads=8, layers=6),
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
