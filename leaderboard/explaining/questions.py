"""What if, at a moment of a drive, the agent had seen or met something else: what is asked.

Each edit is a question of its own. It may be of what the agent sees (`drop:traffic_lights`, from
the moment on), of what is inside its policy (`mask:bev,p=0.3`, from the moment on), or of the world
(`remove:actor=17`, at the moment). `answers.py` drives the futures.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from di_envs.edits.conditions import Condition, Term
from di_envs.edits.text import read_edits
from di_envs.edits.world import WorldEdit, is_world_edit, world_edit
from di_envs.route_env import RouteEnv
from leaderboard.records.record import RunRecord
from leaderboard.replaying.recorded_agent import run_agent, run_interventions
from leaderboard.running.episode import close_agent
from leaderboard.running.interventions import Interventions, check_interventions, sort_interventions
from wrappers.interventions.edit import ObservationEdit
from wrappers.interventions.editing import ObservationEditing
from wrappers.interventions.table import observation_edit

AskedEdit = ObservationEdit | WorldEdit


@dataclass(frozen=True, kw_only=True)
class Question:
    """One edit that is asked about, and whoever carries it out.

    Attributes:
        text: The edit as it is written.
        interventions: Those of the run and, where the edit is inside the policy, it too.
        seen: Edits what the agent sees, from the moment on; None if that stays as it is.
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


def read_asked(text: str) -> tuple[AskedEdit, ...]:
    """The edits of a text, joined by `;`.

    Raises:
        EditError: If one cannot be read.
    """
    return tuple(
        world_edit(edit) if is_world_edit(edit) else observation_edit(edit)
        for edit in read_edits(text)
    )


def questions_about(
    edits: Sequence[AskedEdit], at_s: float, run: RunRecord, env: RouteEnv
) -> tuple[Question, ...]:
    """A question for each edit, checked before anything is driven.

    Args:
        edits: What is asked about.
        at_s: Game time from which they hold.
        run: Whose agent is asked.
        env: From `retrace_env(run)`.

    Raises:
        EditError: If an edit is about nothing that this agent has.
        RetraceError: If the agent cannot be made here.
    """
    if not edits:
        return ()
    own = run_interventions(run, env)
    agent = run_agent(run, env)
    after_s = at_s - env.config.control_dt_s / 2.0

    def question(edit: AskedEdit) -> Question:
        if not isinstance(edit, ObservationEdit):
            return Question(text=str(edit.to_text()), interventions=own, world=edit)
        timed = sort_interventions((_from_then_on(edit, after_s),), own.space)
        check_interventions(timed, agent, run.agent)
        if timed.outside:
            return Question(text=str(edit), interventions=own, seen=timed.editing())
        both = dataclasses.replace(own, inside=(*own.inside, *timed.inside))
        return Question(text=str(edit), interventions=both)

    try:
        return tuple(question(edit) for edit in edits)
    finally:
        close_agent(agent)


def _from_then_on(edit: ObservationEdit, after_s: float) -> ObservationEdit:
    """The edit, which does not hold before the moment, whenever else it does."""
    later = Term(name="t", sign=">", number=round(after_s, 6))
    return dataclasses.replace(edit, when=Condition(terms=(*edit.when.terms, later)))
