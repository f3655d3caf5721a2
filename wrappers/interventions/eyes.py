"""What an agent sees of what there is: less than an environment may show, and that edited.

An environment may show more than its agent asked for: a camera for people, the prompt for a study.
`Eyes` are the one way in which all of that becomes what the agent is handed, whether an environment
is wrapped in them (`InterventionWrapper`) or a recorded drive is looked at once more.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from typing_extensions import Self

from wrappers.interventions.context import EditContext
from wrappers.interventions.editing import Memory, ObservationEditing


@dataclass(frozen=True, kw_only=True)
class Eyes:
    """Sees its own part of an observation, edited. A value, like a memory.

    Attributes:
        keys: Entries that it sees at all.
        edits: One after the other.
        memory: What each of them remembers of the moments before.
    """

    keys: frozenset[str]
    edits: tuple[ObservationEditing, ...] = ()
    memory: tuple[Memory, ...] = ()

    @classmethod
    def of(cls, keys: Iterable[str], *edits: ObservationEditing) -> Self:
        """Eyes that have seen nothing yet."""
        return cls(keys=frozenset(keys), edits=edits, memory=tuple(edit.start() for edit in edits))

    def behind(self, edit: ObservationEditing) -> Eyes:
        """These eyes, and one more edit after those that there are, which has seen nothing yet."""
        return replace(self, edits=(*self.edits, edit), memory=(*self.memory, edit.start()))

    def look(
        self, observation: Mapping[str, Any], context: EditContext
    ) -> tuple[Mapping[str, Any], Eyes]:
        """What is seen of an observation, and the eyes for the next moment."""
        shown: Mapping[str, Any] = {
            key: value for key, value in observation.items() if key in self.keys
        }
        kept = []
        for edit, memory in zip(self.edits, self.memory, strict=True):
            shown, after = edit.apply(shown, context, memory)
            kept.append(after)
        return shown, replace(self, memory=tuple(kept))
