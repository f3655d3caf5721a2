"""Target point, command and speed to waypoints, by an MLP: it sees nothing.

Source: Zhai et al., Rethinking the Open-Loop Evaluation of End-to-End Autonomous Driving in
nuScenes (AD-MLP), 2023. What we changed: it has no history of its ego, so that what it does not see
it cannot infer from how it was slowed down either.
"""

from __future__ import annotations

from torch import Tensor, nn

from agents.explain.protocol import Anatomy
from agents.networks.mlp import mlp
from agents.networks.waypoint_heads import StepsHead
from agents.zoo.ego_only.config import EgoOnlyConfig
from agents.zoo.errors import waypoint_error
from agents.zoo.system import Labels, Output, Seen, State, SystemModel
from agents.zoo.told import ToldEncoder


class EgoOnly(SystemModel):
    """The network."""

    def __init__(self, config: EgoOnlyConfig) -> None:
        super().__init__()
        self.config = config
        self.told = ToldEncoder(config.told, config.token)
        self.mix = nn.Sequential(mlp(len(config.told) * config.token, config.width), nn.ReLU())
        self.plan = StepsHead(config.width, config.waypoints)

    def forward(self, seen: Seen, state: State | None = None) -> Output:
        tokens = self.told(seen)  # (B, N, token)
        return Output(waypoints=self.plan(self.mix(tokens.flatten(1))))

    def loss(self, output: Output, labels: Labels) -> dict[str, Tensor]:
        return {"waypoints": waypoint_error(output, labels)}

    @property
    def anatomy(self) -> Anatomy:
        return Anatomy(groups=self.told.groups("told"))
