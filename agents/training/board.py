"""What a training tells to boards that people watch, beside its log: TensorBoard, Weights & Biases.

A view of the log and nothing more: a training is gone on with by its log and checkpoint alone, and
comes to the same bits with boards and without.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from agents.training.config import TrainingError
from agents.training.log import Row

BOARD_FOLDER = "tensorboard"  # of a training's own folder
Tell = Callable[[Row], None]
_ID_FILE = "wandb-id.txt"  # by which a run that goes on is the same one there


@contextmanager
def board(
    folder: Path,
    *,
    first_step: int = 0,
    project: str = "",
    about: Mapping[str, Any] | None = None,
    told: bool = True,
) -> Iterator[Tell]:
    """Yields what takes rows of numbers, each with its `step`.

    Args:
        folder: For TensorBoard's files; nothing is written where it is not installed.
        first_step: What was told of this step and later ones is forgotten: it comes again.
        project: Of Weights & Biases; empty for none.
        about: The settings, which Weights & Biases shows beside.
        told: Of a team's processes only the first tells.

    Raises:
        TrainingError: If a project is named and `wandb` is not installed.
    """
    with ExitStack() as stack:
        tells = []
        if told and (tensorboard := _tensorboard(stack, folder, first_step)) is not None:
            tells.append(tensorboard)
        if told and project:
            tells.append(_wandb(stack, folder, first_step, project, about or {}))

        def tell(row: Row) -> None:
            for each in tells:
                each(row)

        yield tell


def _tensorboard(stack: ExitStack, folder: Path, first_step: int) -> Tell | None:
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        return None
    writer = SummaryWriter(str(folder), purge_step=first_step)
    stack.callback(writer.close)

    def tell(row: Row) -> None:
        step, values = _split(row)
        for name, value in values.items():
            writer.add_scalar(name, value, step)

    return tell


def _wandb(
    stack: ExitStack, folder: Path, first_step: int, project: str, about: Mapping[str, Any]
) -> Tell:
    try:
        import wandb
    except ImportError as error:
        raise TrainingError(
            f"--wandb needs wandb: pip install 'driveinsight[wandb]' ({error})"
        ) from error
    file = folder / _ID_FILE
    goes_on = first_step > 0 and file.is_file()
    folder.mkdir(parents=True, exist_ok=True)
    run = wandb.init(
        project=project,
        name=folder.parent.resolve().name,
        id=file.read_text(encoding="utf-8").strip() if goes_on else None,
        resume="allow" if goes_on else None,
        dir=str(folder),
        config=dict(about),
    )
    file.write_text(run.id, encoding="utf-8")
    stack.callback(run.finish)

    def tell(row: Row) -> None:
        step, values = _split(row)
        run.log(values, step=step)

    return tell


def _split(row: Row) -> tuple[int, dict[str, float]]:
    """The step, and what is known at it."""
    values = {name: value for name, value in row.items() if value is not None and name != "step"}
    step = row["step"]
    assert step is not None, "a row of a log always has its step"
    return int(step), values
