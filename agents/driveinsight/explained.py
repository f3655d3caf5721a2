"""What the DriveInsight policy says of itself to `agents.explain`: its tokens, taps and maps."""

from __future__ import annotations

from typing import Any, Protocol

from torch import Tensor, nn

from agents.base import Observation
from agents.driveinsight.camera import image_groups
from agents.driveinsight.config import BEV, TOKENS, PolicyConfig
from agents.driveinsight.model import Output, Policy
from agents.explain.protocol import Anatomy, FeatureMap, TokenGroup
from di_envs.sensors.camera.config import rig_of


class Planning(Protocol):
    """All that is asked of the agent whose policy is explained."""

    policy: Policy

    def plan(self, observation: Observation, memory: Any) -> Output: ...


class ExplainedAgent:
    """The policy of an agent, with the edits that the agent makes inside it.

    Taps show an activation as it comes, before an edit of that tap.
    """

    def __init__(self, agent: Planning) -> None:
        self._agent = agent
        self.anatomy = anatomy_of(agent.policy.config)

    @property
    def model(self) -> nn.Module:
        """The network."""
        return self._agent.policy

    def waypoints(self, observation: Observation, memory: Any) -> Tensor:
        """(T, 2) of a decision."""
        return self._agent.plan(observation, memory).waypoints[0]


def anatomy_of(config: PolicyConfig) -> Anatomy:
    """Where the components that a policy is given, and its maps, are.

    A component that the configuration never gives has a zero token, whatever happens: nothing
    responds to it, and it is left out.
    """
    groups = {
        name: TokenGroup(tap=f"prompt.taps.{name}", keys=(place, place + 1))
        for place, name in enumerate(TOKENS[:-1])
        if name in config.prompt
    }
    maps: dict[str, FeatureMap] = {}
    if config.sensors:
        first = TOKENS.index(BEV)
        last = first + config.planner.bev_tokens**2
        groups[BEV] = TokenGroup(tap="bev.tokens", keys=(first, last))
        grid = config.grid
        maps[BEV] = FeatureMap(
            tap="perception.memory.bev",
            extent_m=(grid.x_min_m, grid.x_max_m, grid.y_min_m, grid.y_max_m),
        )
    if config.camera is not None:
        for number, group in enumerate(image_groups(rig_of(config.camera.rig))):
            tap = f"perception.camera.views.{number}.features"
            for item, camera in enumerate(group):
                maps[camera.name] = FeatureMap(tap=tap, item=item, camera=camera.name)
    attention = (
        f"planner.layers.{layer}.attention.weights" for layer in range(config.planner.layers)
    )
    return Anatomy(groups=groups, attention=tuple(attention), maps=maps)
