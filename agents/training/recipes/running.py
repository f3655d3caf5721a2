"""Runs a recipe stage by stage, each in a folder of its own; goes on wherever it was cut off."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from agents.training.recipes.kinds import Machine, Progress, StageRun, digest_of
from agents.training.recipes.marker import Marker, found_marker, read_marker, write_marker
from agents.training.recipes.recipe import Recipe, RecipeError, Stage

MARKED_EVERY_S = 20.0  # how long a stage has taken is written down, should it be killed


class Watcher(Protocol):
    """Whoever watches a recipe being run."""

    def begins(self, stage: Stage, number: int, of: int) -> None:
        """A stage begins, or goes on."""

    def tells(self, progress: Progress) -> None:
        """How far it has come."""

    def ends(self, stage: Stage, marker: Marker, number: int, of: int) -> None:
        """It is done."""

    def stop(self) -> bool:
        """Whether to stop."""


@dataclass(frozen=True, kw_only=True)
class Standing:
    """How a stage stands: what its folder says, if there is anything."""

    stage: Stage
    folder: Path
    marker: Marker | None

    @property
    def state(self) -> str:
        """In a word."""
        if self.marker is None:
            return "to do"
        return "done" if self.marker.done else "under way"


def standings(recipe: Recipe, output: Path) -> list[Standing]:
    """How all stages of a recipe stand in a folder.

    Raises:
        RecipeError: If a stage's marker cannot be read.
    """
    folders = {stage.name: output / stage.name for stage in recipe.stages}
    return [
        Standing(stage=stage, folder=folder, marker=read_marker(folder))
        for stage, folder in zip(recipe.stages, folders.values(), strict=True)
    ]


def run_recipe(
    recipe: Recipe,
    output: Path,
    watcher: Watcher,
    *,
    goal: str | None = None,
    machine: Machine | None = None,
    compiling: Callable[[], AbstractContextManager[None]] = nullcontext,
    alone: Callable[[Path], AbstractContextManager[object]] = nullcontext,
) -> bool:
    """Does all stages that are not done, in order.

    Args:
        recipe: It.
        output: A folder that each stage has its own in.
        watcher: Told of it, and asked whether to stop.
        goal: Name of the stage to come to, with all that it needs; None for all stages.
        machine: What it runs on.
        compiling: Entered around work that may compile kernels.
        alone: Entered around work in a stage's folder: keeps others out of it, who may do another
            stage meanwhile.

    Returns:
        False if it was asked to stop before the end.

    Raises:
        RecipeError: If a stage there was made otherwise, or has changed since.
        TrainingError, DriveFileError, WeightsError: What a stage cannot go on from.
    """
    stages = recipe.needed_for(goal)
    kitchen = _Kitchen(
        recipe=recipe,
        output=output,
        watcher=watcher,
        machine=machine or Machine(),
        compiling=compiling,
        alone=alone,
    )
    for stage in stages:  # before hours go into the first that is to be done
        kitchen.check(stage)
    return all(
        kitchen.do(stage, number, len(stages)) for number, stage in enumerate(stages, start=1)
    )


@dataclass(kw_only=True)
class _Kitchen:
    """Where stages are done, and what those that are done have made."""

    recipe: Recipe
    output: Path
    watcher: Watcher
    machine: Machine
    compiling: Callable[[], AbstractContextManager[None]]
    alone: Callable[[Path], AbstractContextManager[object]]
    digests: dict[str, str] = field(default_factory=dict)
    looked_at: set[str] = field(default_factory=set)

    def check(self, stage: Stage) -> None:
        """Refuses what there is of a stage if it was made otherwise, as far as that is known."""
        known = {name: self.digests[name] for name in stage.inputs if name in self.digests}
        folder = self.output / stage.name
        if read_marker(folder) is None:
            return
        if len(known) < len(stage.inputs):
            missing = next(name for name in stage.inputs if name not in known)
            raise RecipeError(
                f"stage '{stage.name}' in {folder} was made of '{missing}', which is not done: "
                f"delete the folder, or put that stage's back"
            )
        marker = found_marker(folder, Marker.of(stage, self.recipe.seed, known), stage)
        if marker.done:
            self.digests[stage.name] = marker.digest

    def do(self, stage: Stage, number: int, of: int) -> bool:
        """Does a stage, or goes on with it; True once it is done."""
        if stage.name in self.digests:
            return True
        if self.watcher.stop():
            return False
        self._look_at_inputs(stage)
        folder = self.output / stage.name
        with self.alone(folder):
            return self._do_alone(stage, folder, number, of)

    def _do_alone(self, stage: Stage, folder: Path, number: int, of: int) -> bool:
        inputs = {name: self.digests[name] for name in stage.inputs}
        wanted = Marker.of(stage, self.recipe.seed, inputs)
        clock = _Clock(folder=folder, marker=found_marker(folder, wanted, stage))
        if clock.marker.done:  # by somebody else, since it was looked at
            self.digests[stage.name] = clock.marker.digest
            return True
        self.watcher.begins(stage, number, of)
        clock.write()
        made = stage.how.run(self._run(stage, clock))
        clock.write()
        if made is None:
            return False
        digest = digest_of(stage.how.makes, folder)
        clock.marker = dataclasses.replace(
            clock.marker, digest=digest, samples=made.samples, said=made.said
        )
        clock.write()
        self.digests[stage.name] = digest
        self.looked_at.add(stage.name)
        self.watcher.ends(stage, clock.marker, number, of)
        return True

    def _look_at_inputs(self, stage: Stage) -> None:
        """Refuses inputs that are no longer what their stage had made."""
        for each in self.recipe.stages:
            if each.name not in stage.inputs or each.name in self.looked_at:
                continue
            folder = self.output / each.name
            if digest_of(each.how.makes, folder) != self.digests[each.name]:
                raise RecipeError(
                    f"{each.how.makes} in {folder} are not those that stage '{each.name}' had "
                    f"made: put them back, or delete the folder to do it again"
                )
            self.looked_at.add(each.name)

    def _run(self, stage: Stage, clock: _Clock) -> StageRun:
        def tell(progress: Progress) -> None:
            clock.tick()
            self.watcher.tells(progress)

        takes: Mapping[str, tuple[Path, ...]] = {
            field: tuple(self.output / name for name in names)
            for field, names in stage.takes.items()
        }
        return StageRun(
            settings=stage.settings,
            folder=clock.folder,
            seed=self.recipe.seed,
            first=stage.first,
            takes=takes,
            machine=self.machine,
            tell=tell,
            stop=self.watcher.stop,
            compiling=self.compiling,
        )


@dataclass(kw_only=True)
class _Clock:
    """Writes down how long a stage has been worked on, all runs together."""

    folder: Path
    marker: Marker
    since_s: float = field(default_factory=time.monotonic)

    def tick(self) -> None:
        """Writes if it was long ago."""
        if time.monotonic() - self.since_s > MARKED_EVERY_S:
            self.write()

    def write(self) -> None:
        """Writes the marker with the time up to now."""
        now_s = time.monotonic()
        spent_s = round(self.marker.spent_s + now_s - self.since_s, 3)
        self.marker = dataclasses.replace(self.marker, spent_s=spent_s)
        self.since_s = now_s
        write_marker(self.folder, self.marker)
