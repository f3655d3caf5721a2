"""What the DriveInsight policy says of itself to `agents.explain`: its tokens, taps and maps."""

from __future__ import annotations

from typing import Any, Protocol

from torch import Tensor, nn

from agents.base import Observation
from agents.driveinsight.camera import image_groups
from agents.driveinsight.config import BEV, TOKENS, PlannerConfig, PolicyConfig
from agents.driveinsight.model import Output, Policy
from agents.driveinsight.seen import OBJECTS, SIGNALS
from agents.explain.protocol import Anatomy, FeatureMap, Span, TokenGroup
from di_envs.prompt import COMPONENTS, LIGHTS, OBSTACLES, STOP_SIGNS
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
    spans = token_spans(config.planner)
    groups = {
        name: TokenGroup(tap=f"prompt.taps.{name}", keys=spans[name])
        for name in COMPONENTS
        if name in config.prompt
    }
    maps: dict[str, FeatureMap] = {}
    if config.sensors:
        groups[BEV] = TokenGroup(tap="bev.tokens", keys=spans[BEV])
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


def token_spans(config: PlannerConfig) -> dict[str, Span]:
    """Where each component's tokens stand among all that the planner looks at."""

    def tokens(rows: int) -> int:
        """Of that many rows."""
        return (rows if config.each_row else 1) + config.next_row

    counts = dict.fromkeys(TOKENS, 1) | {
        "obstacles": tokens(OBSTACLES),
        "traffic_lights": tokens(LIGHTS),
        "stop_signs": tokens(STOP_SIGNS),
        BEV: tokens(OBJECTS) + tokens(SIGNALS) + 1,
    }
    spans, first = dict[str, Span](), 0
    for name, count in counts.items():
        spans[name] = (first, first + count)
        first += count
    return spans
