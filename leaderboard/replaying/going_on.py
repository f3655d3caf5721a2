"""Goes on from a moment of a recorded drive: the one engine under branches and what-if futures.

The world is where the record had it, the agent has the memory and the eyes that it had, to the bit,
as `retracing.py` hands them out. So what differs from the record does so because of an edit. What
was done to the recorded world later is done here too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from agents.base import Agent
from di_envs.edits.world import WorldEdit, apply_world_edits
from di_envs.route_env import RouteEnv
from di_envs.world.state import TICK_S
from leaderboard.records.record import RouteRecord
from leaderboard.replaying.recorded_edits import timed_edits
from leaderboard.replaying.replay import ReplayStep
from leaderboard.replaying.retracing import Decision, looked
from leaderboard.replaying.timed_edits import EditPlan
from leaderboard.running.episode import FaultError, decide, step
from wrappers.interventions.eyes import Eyes


@dataclass(frozen=True, kw_only=True)
class AgentThen:
    """An agent as it is at a moment of a drive.

    Attributes:
        agent: The agent.
        memory: What it remembers.
        eyes: With which it looks then.
    """

    agent: Agent[Any]
    memory: Any
    eyes: Eyes


class GoingOn:
    """A drive that goes on.

    Attributes:
        now: Where it is: at first at the moment itself, as it is seen after the edits.
        fault: CARLA's status and the reason, once the agent's or the simulator's code has failed.
    """

    def __init__(
        self,
        env: RouteEnv,
        record: RouteRecord,
        at: ReplayStep,
        then: AgentThen,
        edits: Sequence[WorldEdit] = (),
    ) -> None:
        """Edits the world, and looks at it.

        Args:
            env: The environment, or a twin, at the moment; it is left somewhere in the future.
            record: What was driven up to there.
            at: The moment.
            then: Who drives on.
            edits: What is changed first.

        Raises:
            EditError: If the world cannot be edited so at that moment.
        """
        apply_world_edits(env, edits)
        self._env, self._agent, self._eyes = env, then.agent, then.eyes
        self._dt_s = env.config.control_dt_s
        self._later = EditPlan(timed_edits(record.interventions), self._dt_s)
        self.fault = ("", "")
        here = replace(at, observation=env.observe(), view=env.view)
        self.now = self._looked(here, then.memory)

    def decides(self) -> bool:
        """One decision, and what it leads to; False where there is none to make.

        Raises:
            EditError: If what was done to the recorded world later cannot be done to this one.
        """
        if self.now.step.over or self.fault[0]:
            return False
        try:
            control, memory = decide(self._agent, self.now.seen, self.now.memory)
            observation, reward, over, info = step(self._env, control)
        except FaultError as fault:
            self.fault = (fault.status, fault.reason)
            return False
        number = self.now.number + 1
        if self._later.apply(self._env, number):
            observation = self._env.observe()
        view = self._env.view
        reached = ReplayStep(
            decision=number,
            time_s=round(int(view.state.tick) * TICK_S, 6),
            control=control,
            observation=observation,
            view=view,
            events=info["events"],
            reward=reward,
            info=info,
            over=over,
        )
        self.now = self._looked(reached, memory)
        return True

    def _looked(self, here: ReplayStep, memory: Any) -> Decision:
        decision, self._eyes = looked(here, self._agent, self._eyes, memory, self._dt_s)
        return decision
