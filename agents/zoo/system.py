"""What a system says of itself: what it sees, what it is to learn, and its network.

A system is a folder with a configuration, a network and an agent. Everything else, from rendering
to the training loop, reads what it needs off these.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from torch import Tensor, nn
from typing_extensions import Self

from agents.base import Requirements
from agents.explain.protocol import Anatomy
from agents.networks.sizes import check_sizes
from di_envs.config import check_name
from di_envs.files.json_values import from_json, to_json
from di_envs.prompt import COMPONENTS
from di_envs.sensors.camera.config import RIGS, Rig
from di_envs.sensors.lidar.config import LIDARS

CONTROL_DT_S = 0.1
MOMENT_DT_S = 0.5  # between the moments of a sequence, and between waypoints
# The family of cameras that all systems see by: each names those that its paper has.
FAMILY = RIGS["driveinsight"]
LABELS = ("action", "raster", "semantics", "objects", "signal", "map", "motion", "future")

Seen = Mapping[str, Tensor]  # what a system sees at a moment, (B, ...) each; see `inputs.inputs_of`
Labels = Mapping[str, Tensor]  # what it is to say, (B, ...) each; see `training.labels`
State = tuple[Tensor, ...]  # what it remembers for the next moment, (B, ...) each


@dataclass(frozen=True, kw_only=True)
class SystemConfig:
    """What every system says; its own configuration adds the sizes of its network.

    Attributes:
        system: Its name in the table of agents.
        cameras: Names of cameras of `FAMILY`, in the order in which they are stacked.
        lidar: Name of a shipped LiDAR; empty for none.
        told: Components of the prompt that it is given.
        raster: Whether it is given the true view from above: that is privileged.
        odometry: Whether it is given where it is, to align what it remembers.
        past: Moments before the present one that training shows it.
        waypoints: How many it plans, `MOMENT_DT_S` apart.
        labels: What it is to learn besides waypoints; of `LABELS`.
    """

    system: str
    cameras: tuple[str, ...] = ()
    lidar: str = ""
    told: tuple[str, ...] = ()
    raster: bool = False
    odometry: bool = False
    past: int = 0
    waypoints: int = 4
    labels: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("cameras", "told", "labels"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        for names, known, what in (
            (self.cameras, [camera.name for camera in FAMILY.cameras], "camera of the family"),
            ((self.lidar,) if self.lidar else (), LIDARS, "LiDAR"),
            (self.told, COMPONENTS, "prompt component"),
            (self.labels, LABELS, "label"),
        ):
            for name in names:
                check_name(name, known, what)
        check_sizes(self, "waypoints")
        if not 0 <= self.past <= 8:
            raise ValueError(f"past must be from 0 to 8 moments, not {self.past}")

    @property
    def name(self) -> str:
        """What cards and errors call it."""
        return self.system

    @property
    def rig(self) -> Rig:
        """The cameras of the family that it sees by."""
        chosen = {camera.name: camera for camera in FAMILY.cameras}
        return Rig(cameras=tuple(chosen[name] for name in self.cameras))

    @property
    def sensors(self) -> bool:
        """Whether it sees anything by a sensor."""
        return bool(self.cameras or self.lidar)

    @property
    def requires(self) -> Requirements:
        """What it needs from its environment: the prompt too, whose speed controllers read."""
        groups = ("camera",) * bool(self.cameras) + ("lidar",) * bool(self.lidar)
        options: dict[str, Any] = {}
        if self.cameras:
            options["cameras"] = self.rig
        if self.lidar:
            options["lidar"] = self.lidar
        return Requirements(
            observations=(*groups, "prompt", *("odometry",) * self.odometry),
            control_dt_s=CONTROL_DT_S,
            options=options,
            privileged=self.raster,
        )

    @property
    def inputs(self) -> str:
        """What it sees, in a few words."""
        seen = [f"{len(self.cameras)} camera{'s' * (len(self.cameras) > 1)}"] * bool(self.cameras)
        seen += ["LiDAR"] * bool(self.lidar) + ["true raster"] * self.raster
        return ", ".join([*seen, *(name.replace("_", " ") for name in self.told)])

    def to_mapping(self) -> dict[str, Any]:
        """As values that JSON has."""
        values: dict[str, Any] = to_json(self)
        return values

    @classmethod
    def from_mapping(cls, values: Any, source: str = "configuration of a system") -> Self:
        """The inverse of `to_mapping`.

        Raises:
            JsonError: If a field is unknown, missing or of another type, or a value is refused.
        """
        return from_json(cls, values, source)


@dataclass(frozen=True, kw_only=True)
class Output:
    """What a system says at a moment.

    Attributes:
        waypoints: (B, T, 2) x ahead, y right [m], `MOMENT_DT_S` apart. Of a system that says an
            action: where that would lead.
        action: (B, 2) throttle less brake, and steer, both -1..1; None of one that says waypoints.
        said: All else that its loss or its rules read, by name.
        state: What it remembers for the next moment; empty without a memory.
    """

    waypoints: Tensor
    action: Tensor | None = None
    said: Mapping[str, Tensor] | None = None
    state: State = ()


class SystemModel(nn.Module, ABC):
    """The network of a system; a pure function of what is seen and what was remembered."""

    config: SystemConfig

    @abstractmethod
    def forward(self, seen: Seen, state: State | None = None) -> Output:
        """Plans.

        Args:
            seen: What is seen at a moment.
            state: What the moment before it, `MOMENT_DT_S` ago, had it remember; None at first.
        """

    def given(self, value: Tensor) -> Tensor:
        """A value that what comes next is to take as it is: training stops its gradient there.

        While it drives none is stopped, so that whoever explains it sees all that it rests on.
        """
        return value.detach() if self.training else value

    @abstractmethod
    def loss(self, output: Output, labels: Labels) -> dict[str, Tensor]:
        """The terms that training brings down, by name; their sum is the loss.

        `waypoints` is among them and in metres (`errors.waypoint_error`): the weights of all others
        are told relative to it.
        """

    @property
    @abstractmethod
    def anatomy(self) -> Anatomy:
        """Its token groups, attention and maps, for `agents.explain`."""


class TaughtModel(SystemModel):
    """One with a teacher inside that no longer learns: its norms stay as they are, too."""

    teacher: nn.Module

    def train(self, mode: bool = True) -> Self:
        """It learns; the teacher stays as it is."""
        super().train(mode)
        self.teacher.eval()
        return self


@dataclass(frozen=True, kw_only=True)
class System:
    """A folder of the zoo.

    Attributes:
        configs: Its configurations by their names in the table of agents.
        model: Of its network, which is made from a configuration.
        eyes: Shipped policy whose cameras are its own, `eyes.BevEyes`, and are not trained again;
            empty for fresh ones, which learn.
    """

    configs: Mapping[str, SystemConfig]
    model: Callable[[Any], SystemModel]
    eyes: str = ""

    FORMAT_VERSION: ClassVar[int] = 1  # of configurations and weights on disk
