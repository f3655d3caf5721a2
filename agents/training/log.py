"""What a training tells of itself: rows of numbers in a CSV file, and a picture of them."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from pathlib import Path

from agents.training.config import HELD_OUT, TrainingError
from di_envs.files.received import read_bytes
from di_envs.files.whole import write_whole

Row = Mapping[str, float | None]


def append_row(path: Path, row: Row) -> None:
    """Appends a row; the first one brings the names of the columns, None leaves one empty."""
    fresh = not path.exists() or not path.stat().st_size
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        if fresh:
            writer.writerow(row)
        writer.writerow([_text(value) for value in row.values()])


def read_rows(path: Path) -> list[dict[str, float]]:
    """All rows, without what is empty in them; none if there is no file."""
    names, rows = _table(path)
    return [
        {name: float(text) for name, text in zip(names, row, strict=True) if text} for row in rows
    ]


def forget_rows_after(path: Path, step: int) -> None:
    """Takes away what was written after a checkpoint: it comes again."""
    if not path.exists():
        return
    names, rows = _table(path)
    kept = [row for row in rows if float(row[names.index("step")]) <= step]
    text = io.StringIO(newline="")
    csv.writer(text).writerows([names, *kept] if names else [])
    if text.getvalue().encode() != read_bytes(path):
        write_whole(path, text.getvalue())


def _table(path: Path) -> tuple[list[str], list[list[str]]]:
    """The columns' names and the rows, but for those that a kill cut short or that are garbled.

    Raises:
        TrainingError: If it is some other file.
    """
    if not path.exists():
        return [], []
    try:
        text = read_bytes(path).decode("utf-8", errors="replace")
        names, *rows = list(csv.reader(io.StringIO(text, newline=""))) or [[]]
    except (OSError, csv.Error) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise TrainingError(f"{path} is no log of a training ({why}): remove it") from error
    if not names:
        return [], []
    if "step" not in names:
        raise TrainingError(f"{path} is no log of a training: remove it, or name another --output")
    whole = text.endswith("\n")  # else the last row was cut short, perhaps within a number
    kept = [row for row in (rows if whole else rows[:-1]) if _is_row(row, names)]
    return names, kept


def _is_row(row: list[str], names: list[str]) -> bool:
    """Whether these are numbers, or nothing, under each name; a row always has its step."""
    try:
        values = [float(text) for text in row if text]
    except ValueError:
        return False
    whole = len(row) == len(names) and bool(row[names.index("step")])
    return whole and all(map(math.isfinite, values))


def _text(value: float | None) -> str:
    if value is None:
        return ""
    return str(int(value)) if float(value).is_integer() else f"{value:.6g}"


def write_curve(path: Path, log: list[dict[str, float]], checks: list[dict[str, float]]) -> bool:
    """Draws loss terms over steps, and driving scores where there are any.

    Args:
        path: A PNG.
        log: Rows with `step` and loss terms, some with `HELD_OUT` too.
        checks: Rows with `step` and `driving_score`.

    Returns:
        False without Matplotlib, or without anything to draw.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return False
    if len(log) < 2:
        return False
    figure = Figure(figsize=(7.0, 3.4), layout="constrained")
    axes = figure.add_subplot()
    steps = [row["step"] for row in log]
    for name in log[0]:
        if name not in ("step", "total") and not name.startswith(HELD_OUT):
            axes.plot(steps, [row[name] for row in log], label=name, linewidth=1.0)
    measured = [row for row in log if HELD_OUT in row]
    if measured:
        values = [row[HELD_OUT] for row in measured]
        label = "waypoints, drives kept out"
        axes.plot([row["step"] for row in measured], values, "k.--", label=label, linewidth=1.0)
    axes.set(xlabel="step", ylabel="loss (waypoints: m)", yscale="log")
    axes.grid(alpha=0.3)
    if checks:
        beside = axes.twinx()
        scores = [row["driving_score"] for row in checks]
        beside.plot([row["step"] for row in checks], scores, "ko-", label="driving score")
        beside.set(ylabel="driving score", ylim=(0.0, 100.0))
        beside.legend(loc="lower right", frameon=False)
    axes.legend(loc="upper right" if not checks else "upper center", frameon=False)
    figure.savefig(path, dpi=130)
    return True
