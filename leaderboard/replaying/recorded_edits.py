"""What a record says was edited, as values: of the world, and of what the agent saw.

Records keep edits as text. It is read here, and no sooner than somebody carries the edits out: an
edit of one's own is imported when it is read, which looking at a record must not do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

from agents.ownership import code_at
from di_envs.edits.text import EditError, EditText, read_edit
from di_envs.edits.world import is_world_edit, world_edit
from leaderboard.replaying.timed_edits import TimedEdit
from wrappers.interventions.edit import ObservationEdit
from wrappers.interventions.table import observation_edit


def timed_edits(interventions: Iterable[str]) -> tuple[TimedEdit, ...]:
    """Those of a record's interventions that change the world.

    Raises:
        EditError: If one of them cannot be read.
    """
    texts = map(read_edit, interventions)
    return tuple(_timed(text) for text in texts if is_world_edit(text))


def seen_texts(interventions: Iterable[str]) -> tuple[str, ...]:
    """Those that leave the world as it is, as the record has them.

    Raises:
        EditError: If one of them does not have the form of an edit.
    """
    return tuple(text for text in interventions if not is_world_edit(read_edit(text)))


def code_of_edits(interventions: Iterable[str]) -> Iterator[str]:
    """What would be imported to carry edits out: of those of our table, nothing."""
    for text in dict.fromkeys(interventions):
        try:
            place, _, name = read_edit(text).verb.rpartition(".")
        except EditError:
            continue  # refused where it is carried out
        if place:
            yield f"{name} of {code_at(place)}"


def seen_edits(interventions: Iterable[str]) -> tuple[ObservationEdit, ...]:
    """Those that leave the world as it is, and edit what the agent sees.

    Raises:
        EditError: If one of them cannot be read.
    """
    return tuple(observation_edit(read_edit(text)) for text in seen_texts(interventions))


def _timed(text: EditText) -> TimedEdit:
    name, _, time = text.when.partition("=")
    try:
        time_s = float(time)
    except ValueError:
        time_s = math.nan
    if name != "t" or not 0.0 <= time_s < math.inf:
        raise EditError(f"'{text}' does not say when: expected @t=SECONDS behind a world edit")
    return TimedEdit(edit=world_edit(replace(text, when="")), time_s=time_s)
