"""The agent `random`: keyed draws, so that a seed gives the same drive in any process and order."""

from __future__ import annotations

from dataclasses import dataclass, replace

from agents.base import Control, Observation, Requirements, make_control
from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.town.plan import RoutePlan


@dataclass(frozen=True, kw_only=True)
class RandomMemory:
    """The episode's seed and the number of decisions so far."""

    seed: int
    decision: int = 0


class RandomAgent:
    """Draws throttle, steering and brake uniformly, and holds each draw for `hold` decisions.

    Pedals are not pressed together: one draw in [-1, 1] is throttle above zero and brake below.
    """

    requires = Requirements()

    def __init__(self, hold: int = 10, max_steer: float = 0.5) -> None:
        if hold < 1:
            raise ValueError(f"hold must be at least one decision, not {hold}")
        if not 0.0 <= max_steer <= 1.0:
            raise ValueError(f"max_steer must lie in [0, 1], not {max_steer}")
        self._hold = hold
        self._max_steer = max_steer

    def start(self, plan: RoutePlan, seed: int) -> RandomMemory:
        """Remembers the seed."""
        return RandomMemory(seed=seed)

    def act(self, observation: Observation, memory: RandomMemory) -> tuple[Control, RandomMemory]:
        """The draw of this stretch of decisions."""
        stretch = memory.decision // self._hold
        steer = 2.0 * uniform(memory.seed, Stream.AGENT, stretch, 0) - 1.0
        pedal = 2.0 * uniform(memory.seed, Stream.AGENT, stretch, 1) - 1.0
        control = make_control(max(pedal, 0.0), self._max_steer * steer, max(-pedal, 0.0))
        return control, replace(memory, decision=memory.decision + 1)

    def close(self) -> None:
        """There is nothing to free."""
