"""What an evaluation edits of what its agent sees: read, sorted, and put around the environment.

Edits of the observation are carried out by a wrapper, whoever the agent is. Edits of what is inside
a policy, at its taps, are carried out by the agent, if it offers `edited(edits) -> agent`.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from agents import load_agent
from agents.base import Agent, Requirements
from di_envs.edits.text import EditError, read_edit, read_edits
from di_envs.edits.world import WORLD_EDITS
from wrappers.interventions.editing import ObservationEditing
from wrappers.interventions.layout import names_in
from wrappers.interventions.single import InterventionWrapper
from wrappers.interventions.table import observation_edit


def read_interventions(text: str) -> tuple[str, ...]:
    """The edits of what an agent sees that a text holds, each as records keep it.

    Raises:
        EditError: If one cannot be read, or is an edit of the world.
    """
    found = []
    for edit in read_edits(text):
        if f"{edit.verb}:{edit.target}" in WORLD_EDITS:
            raise EditError(
                f"'{edit}' edits the world, not what an agent sees: use it at a moment of a "
                f'recorded drive, driveinsight branch RUN --route ID --at 42 --world "{edit}"'
            )
        found.append(str(observation_edit(edit)))
    return tuple(found)


def observation_interventions(interventions: Iterable[str]) -> tuple[str, ...]:
    """Those of a record's interventions that leave the world as it is."""
    texts = [(text, read_edit(text)) for text in interventions]
    return tuple(text for text, edit in texts if f"{edit.verb}:{edit.target}" not in WORLD_EDITS)


@dataclass(frozen=True, kw_only=True)
class Interventions:
    """Edits, sorted by who carries them out.

    Attributes:
        outside: Of the observation.
        inside: Of activations of the agent's policy.
    """

    outside: tuple[str, ...] = ()
    inside: tuple[str, ...] = ()

    def around(self, env: Any) -> Any:
        """The environment as the agent sees it; itself if nothing is edited."""
        return InterventionWrapper(env, "; ".join(self.outside)) if self.outside else env

    def editing(self, space: Any) -> ObservationEditing:
        """The edits of observations of a space."""
        return ObservationEditing("; ".join(self.outside), space)

    def agent(self, spec: str) -> Agent[Any]:
        """The agent of that name, edited inside.

        Raises:
            EditError: If it cannot be.
        """
        agent = load_agent(spec)
        return _edited(agent, spec, self.inside) if self.inside else agent


def sort_interventions(interventions: Iterable[str], space: Any) -> Interventions:
    """Sorts edits: what is not in the observation's space can only be inside the agent."""
    outside: list[str] = []
    inside: list[str] = []
    for text in interventions:
        (outside if _unseen(text, space) is None else inside).append(text)
    return Interventions(outside=tuple(outside), inside=tuple(inside))


def check_interventions(
    interventions: Interventions, spec: str, space: Any, requires: Requirements
) -> None:
    """Refuses edits that cannot be made, before anything is driven; warns of those without effect.

    Raises:
        EditError: If there is one; says what the agent sees, and suggests the nearest.
    """
    interventions.editing(space)
    if interventions.inside:
        try:
            interventions.agent(spec).close()
        except EditError as error:
            unseen = filter(None, (_unseen(text, space) for text in interventions.inside))
            raise EditError(f"{error}. {next(unseen, '')}") from error
    if interventions.outside and requires.privileged:
        warnings.warn(
            f"agent '{spec}' is privileged: it looks at the world itself, so edits of the "
            f"observation ({'; '.join(interventions.outside)}) may change nothing",
            stacklevel=2,
        )


def _unseen(text: str, space: Any) -> EditError | None:
    """Why an edit is of nothing in the observation; None if it is."""
    try:
        for target in read_edit(text).target.split("+"):
            names_in(space, target)
    except EditError as error:
        return error
    return None


def _edited(agent: Agent[Any], spec: str, inside: tuple[str, ...]) -> Agent[Any]:
    edited = getattr(agent, "edited", None)
    if edited is None:
        agent.close()
        raise EditError(
            f"'{inside[0]}' is about nothing that agent '{spec}' is shown, and it has no taps that "
            "could be edited inside it"
        )
    found: Agent[Any] = edited([read_edit(text) for text in inside])
    return found
