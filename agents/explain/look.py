"""Responses and activation maps of one decision together: half the work of asking for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.base import Agent, Observation
from agents.explain.activation import map_taps, maps_of
from agents.explain.differentiate import differentiate_agent
from agents.explain.responses import Response, group_taps, response_of


@dataclass(frozen=True, kw_only=True)
class Look:
    """All that is seen of one decision.

    Attributes:
        response: As `responses_at` gives it.
        maps: As `activation_maps` gives them.
    """

    response: Response
    maps: Mapping[str, NDArray[np.float32]]


def look_at(agent: Agent[Any], observation: Observation, memory: Any) -> Look:
    """Looks at one decision; arguments and errors are those of `differentiate_agent`."""
    anatomy, passed = differentiate_agent(agent, observation, memory, group_taps, map_taps)
    return Look(response=response_of(anatomy, passed), maps=maps_of(anatomy, passed))
