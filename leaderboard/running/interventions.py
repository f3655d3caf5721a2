"""What an evaluation edits of what its agent sees: read, sorted, and put around the environment.

Edits of the observation are carried out by a wrapper, whoever the agent is. Edits of what is inside
a policy, at its taps, are carried out by the agent, if it offers `edited(edits) -> agent`. Text is
read where it enters, on the command line or from a record; from there on edits are values.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from gymnasium import spaces

from agents import load_agent
from agents.base import Agent
from di_envs.config import RouteEnvConfig
from di_envs.edits.text import EditError, read_edits
from di_envs.edits.world import is_world_edit
from di_envs.observation import observation_space
from wrappers.interventions.edit import ObservationEdit
from wrappers.interventions.editing import ObservationEditing
from wrappers.interventions.eyes import Eyes
from wrappers.interventions.layout import names_in
from wrappers.interventions.single import InterventionWrapper
from wrappers.interventions.table import observation_edit


def read_interventions(text: str) -> tuple[ObservationEdit, ...]:
    """The edits of what an agent sees that a text holds.

    Raises:
        EditError: If one cannot be read, or is an edit of the world.
    """
    found = []
    for edit in read_edits(text):
        if is_world_edit(edit):
            raise EditError(
                f"'{edit}' edits the world, not what an agent sees: use it at a moment of a "
                f'recorded drive, driveinsight branch RUN --route ID --at 42 --world "{edit}"'
            )
        found.append(observation_edit(edit))
    return tuple(found)


def texts_of(interventions: Iterable[ObservationEdit]) -> tuple[str, ...]:
    """Edits as records keep them."""
    return tuple(map(str, interventions))


@dataclass(frozen=True, kw_only=True)
class Interventions:
    """Edits, sorted by who carries them out.

    Attributes:
        space: What the agent sees at all.
        outside: Edits of the observation.
        inside: Edits of activations of the agent's policy.
    """

    space: spaces.Dict
    outside: tuple[ObservationEdit, ...] = ()
    inside: tuple[ObservationEdit, ...] = ()

    def around(self, env: Any) -> Any:
        """The environment as the agent sees it; itself if that is all, as it is."""
        if not self.outside and self.space.keys() == env.observation_space.keys():
            return env
        return InterventionWrapper(env, self.outside, sees=self.space)

    def editing(self) -> ObservationEditing:
        """The edits of observations.

        Raises:
            EditError: If one of them cannot be made.
        """
        return ObservationEditing(self.outside, self.space)

    def eyes(self) -> Eyes:
        """With which the agent looks at first.

        Raises:
            EditError: If an edit cannot be made.
        """
        return Eyes.of(self.space, self.editing())

    def agent(self, spec: str, make: Callable[[], Agent[Any]] | None = None) -> Agent[Any]:
        """The agent of that name, edited inside.

        Args:
            spec: Its name.
            make: Makes it; None makes it here.

        Raises:
            EditError: If it cannot be.
        """
        agent = load_agent(spec) if make is None else make()
        try:
            return self.within(agent, spec)
        except EditError:
            agent.close()
            raise

    def within(self, agent: Agent[Any], spec: str) -> Agent[Any]:
        """An agent, edited inside; itself if nothing is.

        Raises:
            EditError: If it cannot be.
        """
        if not self.inside:
            return agent
        edited = getattr(agent, "edited", None)
        if edited is None:
            raise EditError(
                f"'{self.inside[0]}' is about nothing that agent '{spec}' is shown, and it has no "
                "taps that could be edited inside it"
            )
        found: Agent[Any] = edited([edit.to_text() for edit in self.inside])
        return found


def seen_space(groups: Sequence[str], config: RouteEnvConfig) -> spaces.Dict:
    """The space of what an agent sees itself, whatever else an environment shows.

    Args:
        groups: Of observations, that it asks for.
        config: The environment's.
    """
    return observation_space(
        tuple(groups), config.cameras, config.lidar, half_sweeps=config.half_sweeps
    )


def sort_interventions(edits: Iterable[ObservationEdit], space: spaces.Dict) -> Interventions:
    """Sorts edits: what is not in the observation's space can only be inside the agent."""
    outside: list[ObservationEdit] = []
    inside: list[ObservationEdit] = []
    for edit in edits:
        (outside if _unseen(edit, space) is None else inside).append(edit)
    return Interventions(space=space, outside=tuple(outside), inside=tuple(inside))


def check_interventions(interventions: Interventions, agent: Agent[Any], spec: str) -> None:
    """Refuses edits that cannot be made, before anything is driven; warns of those without effect.

    Args:
        interventions: The edits.
        agent: Of whom they are, not edited. It is not closed.
        spec: Its name.

    Raises:
        EditError: If there is one; says what the agent sees, and suggests the nearest.
    """
    interventions.editing()
    try:
        interventions.within(agent, spec)
    except EditError as error:
        unseen = filter(None, (_unseen(edit, interventions.space) for edit in interventions.inside))
        raise EditError(f"{error}. {next(unseen, '')}") from error
    if interventions.outside and agent.requires.privileged:
        edits = "; ".join(texts_of(interventions.outside))
        warnings.warn(
            f"agent '{spec}' is privileged: it looks at the world itself, so edits of the "
            f"observation ({edits}) may change nothing",
            stacklevel=2,
        )


def _unseen(edit: ObservationEdit, space: spaces.Dict) -> EditError | None:
    """Why an edit is of nothing in the observation; None if it is."""
    try:
        for target in edit.targets:
            names_in(space, target)
    except EditError as error:
        return error
    return None
