"""What a stage's folder says of itself: how it was made, from what, how long it took, what came.

A stage that is under way has one too, so that nothing goes on in a folder of other settings.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents.training.recipes.recipe import RecipeError, Stage
from di_envs.differences import differences
from di_envs.files.json_text import JsonError, indented, read_document
from di_envs.files.json_values import from_json, to_json
from di_envs.files.whole import write_whole
from di_envs.world_version import WORLD_VERSION

MARKER_FILE = "stage.json"
FORMAT = "driveinsight stage"
FORMAT_VERSION = 1


@dataclass(frozen=True, kw_only=True)
class Marker:
    """What is known of a stage's folder.

    Attributes:
        kind: Of stage.
        seed: Of the recipe.
        first: Number of each town's first drive, where it drives.
        world_version: In which it was made.
        settings: Of the stage.
        inputs: By name of each stage that it takes from: the digest of what that had made.
        spent_s: How long it has been worked on.
        digest: Of what it has made; empty as long as it is not done.
        samples: Moments driven, or samples learnt from.
        said: What there is to say of it.
    """

    kind: str
    seed: int
    first: int
    world_version: int
    settings: Mapping[str, Any]
    inputs: Mapping[str, str]
    spent_s: float = 0.0
    digest: str = ""
    samples: int = 0
    said: str = ""

    @classmethod
    def of(cls, stage: Stage, seed: int, inputs: Mapping[str, str]) -> Marker:
        """Of a stage that nothing was done of."""
        return cls(
            kind=stage.kind,
            seed=seed,
            first=stage.first,
            world_version=WORLD_VERSION,
            settings=to_json(stage.settings),
            inputs=dict(inputs),
        )

    @property
    def done(self) -> bool:
        """Whether all of it was done."""
        return bool(self.digest)

    def asked(self) -> dict[str, Any]:
        """What decides what comes out, by the names that a recipe has for it."""
        return {
            "kind": self.kind,
            "seed": self.seed,
            "first": self.first,
            "world_version": self.world_version,
            **self.settings,
            **{f"input '{name}'": digest for name, digest in self.inputs.items()},
        }


def read_marker(folder: Path) -> Marker | None:
    """What a stage's folder says; None where there is nothing.

    Raises:
        RecipeError: If it cannot be read.
    """
    path = folder / MARKER_FILE
    if not path.exists():
        return None
    try:
        return from_json(Marker, read_document(path, FORMAT, FORMAT_VERSION), str(path))
    except JsonError as error:
        raise RecipeError(f"{error}: delete {folder} to do that stage again") from error


def write_marker(folder: Path, marker: Marker) -> None:
    """Writes what a stage's folder says."""
    head = {"format": FORMAT, "format_version": FORMAT_VERSION}
    write_whole(folder / MARKER_FILE, indented({**head, **to_json(marker)}))


def found_marker(folder: Path, wanted: Marker, stage: Stage) -> Marker:
    """The marker of a stage that is wanted so: of what was done of it, or of nothing.

    Raises:
        RecipeError: If the folder holds something that was made otherwise; says what differs.
    """
    found = read_marker(folder)
    if found is None:
        return wanted
    if different := differences(_with_defaults(found, stage).asked(), wanted.asked()):
        said = "; ".join(difference.was_is for difference in different)
        raise RecipeError(
            f"stage '{stage.name}' in {folder} was made otherwise ({said}): put that back, or "
            f"delete the folder to do it and what comes of it again, or give another --output"
        )
    return found


def _with_defaults(found: Marker, stage: Stage) -> Marker:
    """With what settings did that are newer than the folder: what their defaults do."""
    if found.kind != stage.kind:
        return found
    try:
        settings: Any = from_json(stage.how.settings, found.settings, MARKER_FILE)
    except JsonError:  # it has one that is no longer there, which is a difference too
        return found
    return dataclasses.replace(found, settings=to_json(settings))
