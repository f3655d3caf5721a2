"""The edits by name, and how their text is read."""

from __future__ import annotations

import importlib
from collections.abc import Mapping

from di_envs.config import check_name
from di_envs.edits.text import EditError, EditText, read_edits
from wrappers.interventions.edit import ObservationEdit
from wrappers.interventions.losing import Blackout, Delay, Mask, Thin
from wrappers.interventions.presence import Clear, Drop, Identity, Zero
from wrappers.interventions.values import Noise, Recolour, Replace, SetValue, Shift

# One literal table: what can be written in front of an edit's colon. Edits of one's own are written
# as module.Class, so that a text alone says what was done, in every process and in every record.
EDITS: Mapping[str, type[ObservationEdit]] = {
    "identity": Identity,
    "drop": Drop,
    "zero": Zero,
    "clear": Clear,
    "set": SetValue,
    "noise": Noise,
    "mask": Mask,
    "shift": Shift,
    "recolour": Recolour,
    "replace": Replace,
    "blackout": Blackout,
    "thin": Thin,
    "delay": Delay,
}


def read_observation_edits(
    text: str, known: Mapping[str, type[ObservationEdit]] = EDITS
) -> tuple[ObservationEdit, ...]:
    """Reads observation edits joined by `;`, such as `drop:routing; set:speed=0@t>5`.

    Args:
        text: The edits.
        known: Edits by verb; a verb with a dot is imported, `package.module.Class`.

    Raises:
        EditError: If one cannot be read; unknown ones are told the nearest that there is.
    """
    return tuple(observation_edit(edit, known) for edit in read_edits(text))


def observation_edit(
    text: EditText, known: Mapping[str, type[ObservationEdit]] = EDITS
) -> ObservationEdit:
    """The observation edit that a text is.

    Raises:
        EditError: If there is none of that name, or its values are refused.
    """
    if "." in text.verb:
        return _imported(text).of(text)
    try:
        check_name(text.verb, known, "edit of what an agent sees")
    except ValueError as error:
        raise EditError(f"'{text}': {error}") from error
    return known[text.verb].of(text)


def _imported(text: EditText) -> type[ObservationEdit]:
    place, _, name = text.verb.rpartition(".")
    try:
        found = getattr(importlib.import_module(place), name, None)
    except ImportError as error:
        raise EditError(f"'{text}': {place} cannot be imported ({error})") from error
    if not (isinstance(found, type) and issubclass(found, ObservationEdit)):
        raise EditError(f"'{text}': {place} has no ObservationEdit called {name}")
    if found.verb != text.verb:
        raise EditError(f"'{text}': the verb of {name} is '{found.verb}'; make it '{text.verb}'")
    return found
