"""What a policy says of itself so that it can be explained: token groups, taps, waypoints.

Any agent whose policy is a torch module can be explained: it has a method `explainable()` that
returns an `Explainable`. Nothing else is asked of it: not its architecture, not its memory, not how
it steers. `docs/explaining.md` brings a small policy of another make.

A **tap** is the dotted path of a submodule whose output is a tensor, such as `planner.attention` (a
`nn.Identity` put there for the purpose will do). A **token group** is a named component of what the
policy decides from, such as `routing`, and where its tokens are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from torch import Tensor, nn

from agents.base import Observation

Span = tuple[int, int]  # first, and one after the last


class NotExplainableError(TypeError):
    """A policy that cannot be looked into; the message says what is missing."""


@dataclass(frozen=True, kw_only=True)
class TokenGroup:
    """Where the tokens of a component are.

    Attributes:
        tap: Whose output holds them: (1, N, width) tokens, or (1, width) for one.
        rows: Which of the N they are; None for all.
        keys: Where they stand along the last axis of the attention weights; None if nobody attends
            to them.
    """

    tap: str
    rows: Span | None = None
    keys: Span | None = None


@dataclass(frozen=True, kw_only=True)
class FeatureMap:
    """A map of features, and what it shows.

    Attributes:
        tap: Whose output it is: (N, C, rows, columns).
        item: Which of the N.
        extent_m: For a map of the ground: x_min, x_max, y_min, y_max [m] in the ego frame; rows go
            along x (ahead), columns along y (right), so cell (0, 0) is at x_min, y_min. None for
            features of an image, whose rows go down and columns right over the whole picture.
        camera: For features of an image: its key in the observation.
    """

    tap: str
    item: int = 0
    extent_m: tuple[float, float, float, float] | None = None
    camera: str | None = None


@dataclass(frozen=True, kw_only=True)
class Anatomy:
    """The parts of a policy that can be looked at.

    Attributes:
        groups: Component name to where its tokens are, in the order in which they are shown.
        attention: Taps of attention weights (1, heads, queries, keys), one a layer; rows of them
            sum to 1 over the keys.
        maps: Name to a map of features.
    """

    groups: Mapping[str, TokenGroup] = field(default_factory=dict)
    attention: tuple[str, ...] = ()
    maps: Mapping[str, FeatureMap] = field(default_factory=dict)


@runtime_checkable
class Explainable(Protocol):
    """A policy that can be looked into while it decides.

    Attributes:
        model: The network that the taps are in.
        anatomy: Its parts.
    """

    @property
    def model(self) -> nn.Module: ...

    @property
    def anatomy(self) -> Anatomy: ...

    def waypoints(self, observation: Observation, memory: Any) -> Tensor:
        """What it decides at a moment of a drive, computed by `model`.

        Args:
            observation: As `act` was given it.
            memory: As `act` was given it.

        Returns:
            (T, 2) x ahead, y right of the present ego [m], part of torch's graph: no `no_grad`, no
            `inference_mode`, no `detach` on the way.
        """
        ...


def explainable(agent: Any) -> Explainable:
    """What an agent says of its policy.

    Raises:
        NotExplainableError: If it says nothing, or names neither tokens nor maps.
    """
    offered = getattr(agent, "explainable", None)
    if offered is None:
        raise NotExplainableError(
            f"{type(agent).__name__} cannot be explained: it has no method explainable(). "
            "docs/explaining.md shows how a torch policy gets one"
        )
    policy: Explainable = offered()
    if not isinstance(policy, Explainable):
        raise NotExplainableError(
            f"{type(agent).__name__}.explainable() returned a {type(policy).__name__}; it must have"
            " model, anatomy and waypoints(observation, memory), see agents/explain/protocol.py"
        )
    anatomy = policy.anatomy
    if not anatomy.groups and not anatomy.maps:
        raise NotExplainableError(
            f"{type(agent).__name__} names no taps: its anatomy has neither token groups nor "
            "feature maps, so there is nothing to look at"
        )
    return policy
