"""Two futures of one moment: a recorded episode goes on from there in a changed world.

The agent drives the recorded part again, as its memory is not in the record; what it sees and what
it does are compared with the record at every decision, so the branch begins where the recorded
episode was, to the bit, or not at all. Then the world is edited, and the agent drives on.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from di_envs.edits.text import EditError
from di_envs.edits.world import WorldEdit
from di_envs.route_env import RouteEnv
from di_envs.rules import rules_named
from leaderboard.records.episode_hash import observation_check
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.replay import replay_env, sensor_options
from leaderboard.replaying.timed_edits import EditPlan, TimedEdit, decisions_before, timed_edits
from leaderboard.running.episode import drive_route
from leaderboard.running.interventions import sort_interventions
from leaderboard.running.jobs import Job


class BranchError(Exception):
    """A moment from which a record cannot be continued; the message says why."""


@dataclass(frozen=True, kw_only=True)
class Branch:
    """Two futures.

    Attributes:
        at_s: Game time up to which they are one.
        edits: What was changed then.
        recorded: The future that was.
        edited: The one that would have been.
    """

    at_s: float
    edits: tuple[WorldEdit, ...]
    recorded: RouteRecord
    edited: RouteRecord


def branch(
    run: RunRecord,
    record: RouteRecord,
    at_s: float,
    edits: Sequence[WorldEdit],
    *,
    on_step: Callable[[float], None] = lambda time_s: None,
) -> Branch:
    """Drives a recorded route on from a moment, in a changed world.

    Args:
        run: The run that the record is of.
        record: The route.
        at_s: Game time; the decisions that were due before it are the recorded ones.
        edits: What is changed then; without any, the recorded future comes out again.
        on_step: Told the game time after every decision.

    Raises:
        BranchError: If there is no such moment, or the agent does not come there as recorded.
        EditError: If an edit cannot be made at that moment, or the record's cannot be read.
        ReplayError: If the run's environment cannot be made here.
    """
    own = timed_edits(record.interventions)
    if own:
        edits_made = "; ".join(map(str, own))
        raise BranchError(f"the recorded world was edited already ({edits_made})")
    env = replay_env(run, **sensor_options(run))
    decisions = decisions_before(at_s, env.config.control_dt_s)
    if not 0 <= decisions < record.steps:
        last_s = max(record.steps - 1, 0) * env.config.control_dt_s
        raise BranchError(
            f"route {record.route_id}, seed {record.seed} was driven to {record.game_s:g} s: "
            f"branch it between 0 and {last_s:g} s, not at {at_s:g} s"
        )
    timed = [TimedEdit(edit=edit, time_s=at_s) for edit in edits]
    seen = sort_interventions(record.interventions, env.observation_space)
    branching = Branching(seen.around(env), record, decisions, timed, on_step)
    edited = drive_route(
        branching,
        lambda: seen.agent(run.agent),
        Job(index=0, route_id=record.route_id, seed=record.seed),
        rules_named(run.rules),
        interventions=(*record.interventions, *map(str, timed)),
    )
    env.close()
    if branching.refused is not None:
        raise branching.refused
    return Branch(at_s=at_s, edits=tuple(edits), recorded=record, edited=edited)


def branch_run(run: RunRecord, branch: Branch) -> RunRecord:
    """A run of the edited future alone: it can be written, replayed and verified as any other."""
    options = {**run.options, "route_ids": [branch.edited.route_id]}
    return dataclasses.replace(
        run, options=options, seeds=(branch.edited.seed,), planned=1, routes=(branch.edited,)
    )


def same_future(one: RouteRecord, other: RouteRecord) -> bool:
    """Whether two drives are the same to the bit, wherever in their runs they stand."""
    return (
        dataclasses.replace(one, index=0).fingerprint()
        == dataclasses.replace(other, index=0).fingerprint()
    )


class Branching(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Compares with the record up to a moment, then edits the world, then stands aside.

    Attributes:
        refused: Why the branch does not begin; None while all is well.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        record: RouteRecord,
        decisions: int,
        edits: Sequence[TimedEdit],
        on_step: Callable[[float], None],
    ) -> None:
        super().__init__(env)
        self._route_env: RouteEnv = env.unwrapped  # type: ignore[assignment]
        self._decisions, self._on_step = decisions, on_step
        self._plan = EditPlan(edits, self._route_env.config.control_dt_s)
        self._controls, self._checks = record.control_array(), record.check_array()
        self._done = 0
        self.refused: BranchError | EditError | None = None

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        """Resets the environment; edits the world if the branch begins at once."""
        observation, info = self.env.reset(**arguments)
        self._done = 0
        return self._looked_at(observation), info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Steps the environment; edits the world where the branch begins."""
        if self._done < self._decisions:
            self._compare("acts", np.array_equal(self._controls[self._done], action))
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._done += 1
        self._on_step(info["game_time_s"])
        return self._looked_at(observation), reward, terminated, truncated, info

    def _looked_at(self, observation: Mapping[str, Any]) -> Mapping[str, Any]:
        """What the agent is shown: after the edits, where they are due."""
        if self._done <= self._decisions:
            check = int(self._checks[self._done])
            self._compare("sees", check == observation_check(observation))
        try:
            edited = self._plan.apply(self._route_env, self._done)
        except EditError as error:
            self._refuse(error)
        return self.env.get_wrapper_attr("observe")() if edited else observation

    def _compare(self, what: str, equal: bool) -> None:
        if not equal:
            time_s = self._done * self._route_env.config.control_dt_s
            self._refuse(
                BranchError(
                    f"at {time_s:g} s the agent {what} otherwise than recorded: it, its weights, "
                    f"the package versions or the CPU are not those of the run"
                )
            )

    def _refuse(self, error: BranchError | EditError) -> None:
        """Ends the drive: `drive_route` takes any exception for a crash, so it is kept here."""
        self.refused = error
        raise error
