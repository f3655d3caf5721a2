"""What `driveinsight train --recipe` does: a recipe's stages, shown, stopped, listed."""

from __future__ import annotations

import shlex
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

from leaderboard.commands.ending import EXIT_INTERRUPTED, UsageError, say
from leaderboard.running.terminal import Terminal

if TYPE_CHECKING:
    from agents.training.recipes.kinds import Machine
    from agents.training.recipes.recipe import Recipe

WORKERS = 2  # where nobody says how many


def run_recipe_file(
    path: Path,
    output: Path,
    *,
    goal: str | None,
    minutes: float | None,
    listed: bool,
    workers: int | None,
    device: str,
) -> int:
    """Does the stages of a recipe that are not done, or lists all; returns the exit code.

    Args:
        path: Of the recipe.
        output: Folder for those of the stages.
        goal: Name of the stage to come to, with all that it needs; None for all stages.
        minutes: After which it stops; None for never.
        listed: List them, do nothing.
        workers: Processes that drive or render; None for `WORKERS`.
        device: Where torch trains.

    Raises:
        UsageError: If it cannot begin or go on.
    """
    if workers is not None and workers < 1:
        raise UsageError("--workers must be at least 1 with --recipe")
    if minutes is not None and not minutes > 0.0:
        raise UsageError("--minutes must be more than 0")
    end_s = float("inf") if minutes is None else monotonic() + 60.0 * minutes

    from agents.driveinsight.weights import WeightsError
    from agents.training.config import TrainingError
    from agents.training.frames import DriveFileError
    from agents.training.recipes.kinds import Machine
    from agents.training.recipes.recipe import RecipeError, read_recipe
    from leaderboard.records.results import ResultsError

    machine = Machine(workers=workers or WORKERS, device=device)
    try:
        recipe = read_recipe(path)
        recipe.needed_for(goal)
        if listed:
            _list(recipe, output)
            return 0
        if not _run(recipe, output, goal, machine, end_s):
            again = ["driveinsight", "train", "--recipe", str(path), "--output", str(output)]
            say("Stopped; what was done is kept.", f"Next: {shlex.join(again)} goes on")
            return EXIT_INTERRUPTED
        _tell_done(recipe, output, goal)
    except (RecipeError, TrainingError, DriveFileError, WeightsError, ResultsError) as error:
        raise UsageError(str(error)) from error
    except (OSError, ValueError) as error:
        raise UsageError(f"{path}: {error}") from error
    return 0


def _run(recipe: Recipe, output: Path, goal: str | None, machine: Machine, end_s: float) -> bool:
    """Does the stages under a bar, up to a time of the clock; returns whether all are done."""
    from agents.training.recipes.running import run_recipe
    from leaderboard.records.folder_lock import folder_lock
    from leaderboard.running.displays.recipe import RecipeDisplay
    from leaderboard.running.interruption import interruptible

    with interruptible() as interruption:
        stages = len(recipe.needed_for(goal))

        def stop() -> bool:
            return interruption.requested or monotonic() > end_s

        with RecipeDisplay(stages, stop=stop, say=say) as display:
            return run_recipe(
                recipe, output, display, goal=goal, machine=machine, alone=folder_lock
            )


def _list(recipe: Recipe, output: Path) -> None:
    from agents.training.recipes.running import standings
    from leaderboard.tables.recipe_table import recipe_table

    found = standings(recipe, output)
    Terminal().print(recipe_table(found))
    left = [standing for standing in found if standing.state != "done"]
    if left:
        say(f"Next: driveinsight train --recipe {recipe.path} --output {output}")


def _tell_done(recipe: Recipe, output: Path, goal: str | None) -> None:
    from agents.training.recipes.kinds import POLICY_FOLDER, Product
    from agents.training.trainees import driver_of

    stages = recipe.needed_for(goal)
    policies = [stage for stage in stages if stage.how.makes == Product.POLICY]
    say(f"All {len(stages)} stages are done: {output}")
    if len(stages) < len(recipe.stages):
        say(f"Next: driveinsight train --recipe {recipe.path} --output {output}")
    elif policies:
        agent = driver_of(output / policies[-1].name / POLICY_FOLDER)
        say(f"Next: driveinsight evaluate --agent {agent} --suite town05_tiny")
