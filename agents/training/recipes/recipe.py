"""Reads a recipe: a TOML file that names stages in order, and rounds of stages that come again.

    seed = 0

    [[stage]]
    name = "expert"
    kind = "collect"
    frames = 14000

    [[stage]]
    name = "policy-0"
    kind = "train"
    data = ["expert"]

    [[stage]]
    rounds = 4                  # what follows in it comes so often

    [[stage.each]]
    name = "drives-{round}"     # 1, 2, 3, 4
    kind = "correct"
    learner = "policy-{before}" # 0, 1, 2, 3
    frames = 5000

    [[stage.each]]
    name = "policy-{round}"
    kind = "train"
    data = ["expert", "drives-*"]   # all that were made before it

What a stage names must come before it, so there is one order, and no stage can wait for itself.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from agents.training.recipes.kinds import StageKind
from agents.training.recipes.table import STAGE_KINDS
from di_envs.files.json_text import JsonError
from di_envs.files.json_values import from_json
from di_envs.files.names import check_name, name_hint
from di_envs.files.plain_text import one_plain_line
from di_envs.files.received import read_bytes

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

DRIVES_A_STAGE = 10_000  # numbers of drives that each stage which drives has to itself, in a town
MOST_ROUNDS = 100
_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")


class RecipeError(ValueError):
    """A file that is no recipe, or a folder that a recipe cannot go on in; says what to do."""


@dataclass(frozen=True, kw_only=True)
class Stage:
    """A stage of a recipe.

    Attributes:
        name: Also of its folder.
        kind: Of `STAGE_KINDS`.
        settings: Of that kind.
        takes: By field of the settings: names of the stages that it takes from, all before it.
        first: Number of each town's first drive, where it drives.
    """

    name: str
    kind: str
    settings: Any
    takes: Mapping[str, tuple[str, ...]]
    first: int

    @property
    def how(self) -> StageKind:
        """What its kind is."""
        return STAGE_KINDS[self.kind]

    @property
    def named(self) -> tuple[str, ...]:
        """The stages that it takes from as the recipe names them: `drives-*` for all of them."""
        values = [getattr(self.settings, name) for name in self.takes]
        return tuple(n for v in values for n in (v if isinstance(v, tuple) else (v,)) if n)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of all stages that it takes from."""
        return tuple(dict.fromkeys(name for names in self.takes.values() for name in names))


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A whole training.

    Attributes:
        path: Of its file.
        seed: Of fresh weights and of all that is drawn.
        stages: In order.
    """

    path: Path
    seed: int
    stages: tuple[Stage, ...]

    @property
    def name(self) -> str:
        """After its file."""
        return self.path.stem

    def needed_for(self, name: str | None) -> tuple[Stage, ...]:
        """A stage and all that it is made of, in order; all stages without a name.

        Raises:
            RecipeError: If there is no such stage; suggests the nearest.
        """
        if name is None:
            return self.stages
        names = [stage.name for stage in self.stages]
        try:
            check_name(name, names, "stage")
        except ValueError as error:
            raise RecipeError(f"{self.path}: {error}") from error
        needed = {name}
        for stage in reversed(self.stages):  # what a stage takes from comes before it
            needed |= set(stage.inputs) if stage.name in needed else set()
        return tuple(stage for stage in self.stages if stage.name in needed)


@dataclass(frozen=True, kw_only=True)
class _File:
    """What a recipe's file has at its top."""

    stage: tuple[dict[str, Any], ...]
    seed: int = 0

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ValueError(f"seed must not be negative, not {self.seed}")
        if not self.stage:
            raise ValueError("a recipe needs one stage at least: [[stage]]")


@dataclass(frozen=True, kw_only=True)
class _Rounds:
    """Stages that come again."""

    rounds: int
    each: tuple[dict[str, Any], ...]

    def __post_init__(self) -> None:
        if not 1 <= self.rounds <= MOST_ROUNDS:
            raise ValueError(f"rounds must be 1 to {MOST_ROUNDS}, not {self.rounds}")


@dataclass(frozen=True, kw_only=True)
class _Head:
    """What all stages have."""

    name: str
    kind: str

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise ValueError(
                f"a stage's name is its folder's: small letters, digits and '-', not {self.name!r}"
            )
        check_name(self.kind, STAGE_KINDS, "kind of stage")


def read_recipe(path: Path) -> Recipe:
    """Reads a recipe.

    Raises:
        RecipeError: If it cannot be read; names the file, the stage and the field.
    """
    try:
        values = tomllib.loads(read_bytes(path).decode("utf-8"))
    except OSError as error:
        raise RecipeError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise RecipeError(f"{path}: is not TOML: {one_plain_line(str(error))}") from error
    try:
        file = from_json(_File, values, str(path))
        return Recipe(path=path, seed=file.seed, stages=_stages(file, str(path)))
    except JsonError as error:
        raise RecipeError(str(error)) from error


def _stages(file: _File, source: str) -> tuple[Stage, ...]:
    found = _Found()
    for number, table in enumerate(file.stage, start=1):
        for one in _repeated(table, f"{source}: stage {number}"):
            found.add(one, source)
    return tuple(found.stages)


def _repeated(table: Mapping[str, Any], source: str) -> Iterator[Mapping[str, Any]]:
    """The tables that a table stands for: itself, or those of its rounds."""
    if "rounds" not in table:
        yield table
        return
    rounds = from_json(_Rounds, table, source)
    for number in range(1, rounds.rounds + 1):
        for each in rounds.each:
            yield _filled_in(each, {"{round}": str(number), "{before}": str(number - 1)})


def _filled_in(value: Any, words: Mapping[str, str]) -> Any:
    """A value with the number of the round, and of the one before, in all its texts."""
    if isinstance(value, str):
        for word, number in words.items():
            value = value.replace(word, number)
        return value
    if isinstance(value, list):
        return [_filled_in(item, words) for item in value]
    if isinstance(value, Mapping):
        return {name: _filled_in(item, words) for name, item in value.items()}
    return value


@dataclass(kw_only=True)
class _Found:
    """The stages read so far."""

    stages: list[Stage] = field(default_factory=list)
    driving: int = 0

    def add(self, table: Mapping[str, Any], source: str) -> None:
        """One more."""
        at = f"{source}: stage '{table.get('name', len(self.stages) + 1)}'"
        head = from_json(_Head, {k: v for k, v in table.items() if k in ("name", "kind")}, at)
        if any(stage.name == head.name for stage in self.stages):
            raise RecipeError(f"{at}: there are two stages of that name")
        how = STAGE_KINDS[head.kind]
        rest = {name: value for name, value in table.items() if name not in ("name", "kind")}
        settings: Any = from_json(how.settings, rest, at)
        takes = {name: self._named(settings, name, how, at) for name in how.takes}
        first = self.driving * DRIVES_A_STAGE if how.drives else 0
        self.driving += how.drives
        self.stages.append(
            Stage(name=head.name, kind=head.kind, settings=settings, takes=takes, first=first)
        )

    def _named(self, settings: Any, name: str, how: StageKind, at: str) -> tuple[str, ...]:
        """The stages that a field names; of a pattern those of the right sort."""
        value, wanted = getattr(settings, name), how.takes[name]
        patterns: Sequence[str] = value if isinstance(value, tuple) else (value,) if value else ()
        found = list[str]()
        for pattern in patterns:
            made = {s.name: s.how.makes for s in self.stages if fnmatchcase(s.name, pattern)}
            fits = [stage for stage, makes in made.items() if makes == wanted]
            if not fits:
                known = [stage.name for stage in self.stages if stage.how.makes == wanted]
                what = f"makes {next(iter(made.values()))}" if made else "is no stage before it"
                raise RecipeError(
                    f"{at}: {name}: {pattern!r} {what}, and one that makes {wanted} is wanted; "
                    f"{name_hint(pattern, known)}"
                )
            found += fits
        return tuple(dict.fromkeys(found))
