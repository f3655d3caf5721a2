"""What if, at a moment of a drive, the agent had seen or met something else: the edits asked about.

Each edit of a text is a question of its own. It may be of what the agent sees
(`drop:traffic_lights`, from the moment on), of what is inside its policy (`mask:bev,p=0.3`, from
the moment on), or of the world (`remove:actor=17`, at the moment). `futures.py` answers them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from gymnasium import spaces

from agents.base import Agent
from di_envs.edits.conditions import Condition, Term
from di_envs.edits.text import EditError, EditText, read_edits
from di_envs.edits.world import WORLD_EDITS, WorldEdit, world_edit
from di_envs.route_env import RouteEnv
from leaderboard.records.record import RunRecord
from leaderboard.replaying.retracing import own_space, run_agent, run_interventions
from leaderboard.running.episode import close_agent
from leaderboard.running.interventions import Interventions, check_interventions, sort_interventions
from wrappers.interventions.editing import ObservationEditing


@dataclass(frozen=True, kw_only=True)
class Question:
    """One edit that is asked about, and whoever carries it out.

    Attributes:
        text: As it was written.
        seen: Edits what the agent sees, from the moment on; None if that stays as it is.
        interventions: Those of the run and, where the edit is inside the policy, it too.
        world: Edits the world at the moment; None if that stays as it is.
    """

    text: str
    interventions: Interventions
    seen: ObservationEditing | None = None
    world: WorldEdit | None = None

    @property
    def within(self) -> bool:
        """Whether it takes an agent of its own: the edit is inside the policy."""
        return self.seen is None and self.world is None


def read_questions(text: str, at_s: float, run: RunRecord, env: RouteEnv) -> tuple[Question, ...]:
    """The edits of a text, checked before anything is driven.

    Args:
        text: Edits joined by `;`.
        at_s: Game time from which they hold.
        run: Whose agent is asked.
        env: From `retrace_env(run)`.

    Raises:
        EditError: If an edit cannot be read, or is about nothing that this agent has.
        RetraceError: If the agent cannot be made here.
    """
    edits = read_edits(text)
    if not edits:
        return ()
    after_s = at_s - env.config.control_dt_s / 2.0
    agent = run_agent(run, env)
    try:
        return tuple(_questions(edits, after_s, run, env, agent))
    finally:
        close_agent(agent)


def _questions(
    edits: tuple[EditText, ...], after_s: float, run: RunRecord, env: RouteEnv, agent: Agent[Any]
) -> Iterator[Question]:
    space, own = own_space(run, env), run_interventions(run, env)
    for edit in edits:
        if f"{edit.verb}:{edit.target}" in WORLD_EDITS:
            if edit.when:
                raise EditError(
                    f"'{edit}': the world is edited at the moment; leave out @{edit.when}"
                )
            yield Question(text=str(edit), interventions=own, world=world_edit(edit))
        else:
            yield _question(edit, str(_from_then_on(edit, after_s)), run, own, space, agent)


def _question(
    edit: EditText,
    timed: str,
    run: RunRecord,
    own: Interventions,
    space: spaces.Dict,
    agent: Agent[Any],
) -> Question:
    sorted_edit = sort_interventions((timed,), space)
    check_interventions(sorted_edit, run.agent, space, agent.requires)
    if sorted_edit.outside:
        return Question(text=str(edit), interventions=own, seen=sorted_edit.editing(space))
    both = dataclasses.replace(own, inside=(*own.inside, *sorted_edit.inside))
    return Question(text=str(edit), interventions=both)


def _from_then_on(edit: EditText, after_s: float) -> EditText:
    """The edit, which does not hold before the moment, whenever else it does."""
    later = Term(name="t", sign=">", number=round(after_s, 6))
    terms = (*Condition.of(edit.when).terms, later)
    return dataclasses.replace(edit, when=str(Condition(terms=terms)))
