"""Three ways to take a component away, never confused, and the edit that edits nothing.

drop:X   it is not given: its flag in `prompt_present` is cleared, and the policy zeroes the
         token behind its encoder, exactly as dropout did in training
zero:X   it is given, and its numbers are zeros; rows that were there are still marked as such
clear:X  it is given, and says "nothing there": no rows are valid, no light has a state
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from di_envs.edits.text import EditError
from di_envs.prompt import COMPONENTS
from wrappers.interventions.context import EditContext
from wrappers.interventions.edit import Draws, Observation, ObservationEdit
from wrappers.interventions.layout import has_valid

FLAGS = "prompt_present"


@dataclass(frozen=True, kw_only=True)
class Identity(ObservationEdit):
    """Nothing is changed: what a study's null row does."""

    verb = "identity"
    stays = True

    def edited(self, name: str, value: Any, draws: Draws, context: EditContext) -> Any:
        return value


@dataclass(frozen=True, kw_only=True)
class Drop(ObservationEdit):
    """Components of the prompt are not given."""

    verb = "drop"
    stays = True

    def check(self, name: str, space: spaces.Dict) -> None:
        if name not in COMPONENTS:
            raise EditError(
                f"drop:{name}: only components of the prompt have a flag that says whether they "
                f"are given: {', '.join(COMPONENTS)}. Write zero:{name} for zeros"
            )
        if FLAGS not in space.spaces:
            raise EditError(
                f"drop:{name}: the agent sees no {FLAGS}, so it is not told what is given; make "
                f"the environment with the group 'prompt', or write zero:{name}"
            )

    def changes(
        self, names: tuple[str, ...], observation: Observation, context: EditContext, memory: Any
    ) -> tuple[dict[str, Any], Any]:
        flags = observation[FLAGS].copy()
        for name in names:
            flags[..., COMPONENTS.index(name)] = 0
        return {FLAGS: flags}, memory


@dataclass(frozen=True, kw_only=True)
class Zero(ObservationEdit):
    """The numbers are zeros; what is valid stays so."""

    verb = "zero"
    stays = True

    def edited(self, name: str, value: Any, draws: Draws, context: EditContext) -> Any:
        if has_valid(name):
            value[..., :-1] = 0
        else:
            value[...] = 0
        return value


@dataclass(frozen=True, kw_only=True)
class Clear(ObservationEdit):
    """Nothing is there: no road ahead, nobody near, no light, no hit, no command."""

    verb = "clear"
    stays = True

    def check(self, name: str, space: spaces.Dict) -> None:
        if not (has_valid(name) or name in ("command", "lidar", "lidar_semantic")):
            raise EditError(
                f"clear:{name}: a zero is a value of {name} like any other, nothing says 'nothing "
                f"there'. Write zero:{name}, or drop:{name} if it is part of the prompt"
            )

    def edited(self, name: str, value: Any, draws: Draws, context: EditContext) -> Any:
        return np.zeros_like(value)
