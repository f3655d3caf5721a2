"""What a learner is not told while it is corrected: some components, in a share of its drives.

Who is corrected only while it is told everything is never shown the way on from where it stands
because it was not told.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from typing_extensions import Self

from agents.base import Agent, Control, Observation, Requirements
from agents.driveinsight.config import BEV, TOKENS
from di_envs.edits.text import EditError, read_edits
from di_envs.files.names import check_name
from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.prompt import COMPONENTS
from di_envs.town.plan import RoutePlan

# Names of several components at once; others are joined by `+`
GROUPS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "privileged": ("map", "obstacles", "traffic_lights", "stop_signs"),
        "speeds": ("speed", "speed_history"),
    }
)
_FLAGS = "prompt_present"


@dataclass(frozen=True, kw_only=True)
class Hiding:
    """What is hidden, and how often; in all other drives nothing is.

    Attributes:
        parts: Of each part its name (components and `GROUPS`, joined by `+`) and its share of
            drives.
    """

    parts: tuple[tuple[str, float], ...] = ()

    @classmethod
    def of(cls, shares: Mapping[str, float]) -> Self:
        """From shares by name, as a recipe has them.

        Raises:
            ValueError: If a name is unknown, or shares are negative or more than one together.
        """
        for name, share in shares.items():
            components_of(name)
            if not 0.0 <= share <= 1.0:
                raise ValueError(f"the share of drives without {name} is 0 to 1, not {share}")
        if sum(shares.values()) > 1.0 + 1e-9:
            raise ValueError(
                f"shares of drives with something hidden are 1 together at most, not "
                f"{sum(shares.values()):g}: what is left of 1 is driven with nothing hidden"
            )
        return cls(parts=tuple(shares.items()))

    def shares(self) -> dict[str, float]:
        """The inverse of `of`."""
        return dict(self.parts)

    def hidden_in(self, town: str, number: int) -> tuple[str, ...]:
        """The components that are hidden in a drive: a function of its town and number."""
        key = zlib.crc32(f"{town} {number}".encode())
        draw, below = float(uniform(key, int(Stream.AGENT), 0, 6)), 0.0
        for name, share in self.parts:
            below += share
            if draw < below:
                return components_of(name)
        return ()


EVERYTHING = Hiding()  # is told


def components_of(name: str) -> tuple[str, ...]:
    """The components that a part of `Hiding` names.

    Raises:
        ValueError: If one is unknown; suggests the nearest.
    """
    found = list[str]()
    for part in name.split("+"):
        check_name(part, (*TOKENS, *GROUPS), "component")
        found += GROUPS.get(part, (part,))
    return tuple(dict.fromkeys(found))


def told_less(agent: Agent[Any], hidden: tuple[str, ...]) -> Agent[Any]:
    """The same agent, some components hidden from it as dropout hides them in training.

    Raises:
        ValueError: If it sees nothing itself, and that is to be hidden.
    """
    if BEV in hidden:
        agent = _without_bev(agent)
    flags = tuple(COMPONENTS.index(name) for name in hidden if name != BEV)
    return _ToldLess(agent, flags) if flags else agent


def _without_bev(agent: Agent[Any]) -> Agent[Any]:
    edited = getattr(agent, "edited", None)
    try:
        if edited is None:
            raise EditError(f"{type(agent).__name__} has no inside that can be edited")
        blind: Agent[Any] = edited(read_edits(f"drop:{BEV}"))
    except EditError as error:
        raise ValueError(f"{BEV} cannot be hidden from this learner: {error}") from error
    return blind


class _ToldLess:
    """Shows an agent an observation in which some components are marked as not given."""

    def __init__(self, agent: Agent[Any], flags: tuple[int, ...]) -> None:
        self._agent, self._flags = agent, list(flags)
        self.requires: Requirements = agent.requires

    def start(self, plan: RoutePlan, seed: int) -> Any:
        return self._agent.start(plan, seed)

    def act(self, observation: Observation, memory: Any) -> tuple[Control, Any]:
        present = observation[_FLAGS].copy()
        present[self._flags] = 0
        return self._agent.act({**observation, _FLAGS: present}, memory)

    def close(self) -> None:
        self._agent.close()
