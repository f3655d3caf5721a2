"""What a stage of a recipe can be: settings that are read strictly, and a function that does it.

A stage works in a folder of its own and may be stopped or killed at any moment: run again with the
same settings and inputs, it goes on, and what comes out is the same.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents.training.data_card import drive_paths
from di_envs.files.text_enum import TextEnum

POLICY_FOLDER = "policy"  # of a stage that makes one
SEEN_FOLDER = "seen"  # of one that looks at drives


class Product(TextEnum):
    """What a stage leaves in its folder for those behind it."""

    DRIVES = "drives"
    POLICY = "policy"
    SEEN = "seen rows"


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a stage has come.

    Attributes:
        done: Of `total`.
        total: In all.
        unit: Of both.
        about: What is to be said of it, in a few words.
    """

    done: float
    total: float
    unit: str
    about: str = ""


@dataclass(frozen=True, kw_only=True)
class Machine:
    """What a recipe runs on; no stage's result is another on another machine, but for torch's bits.

    Attributes:
        workers: Processes that drive or render at the same time.
        device: `cpu`, `cuda`, or `auto`: a GPU if there is one.
    """

    workers: int = 1
    device: str = "auto"


@dataclass(frozen=True, kw_only=True)
class StageRun:
    """What a stage is given when it is run.

    Attributes:
        settings: Of the stage's kind.
        folder: Of its own; what an earlier run left is there.
        seed: Of all that is drawn.
        first: Number of each town's first drive, where it drives: no two stages share one.
        takes: By field of the settings: the folders of the stages that it names.
        machine: What it runs on.
        tell: Told how far it has come.
        stop: Whether it is asked to stop; what is there then must be enough to go on from.
        compiling: Entered around work that may compile kernels, so that somebody can say so.
    """

    settings: Any
    folder: Path
    seed: int
    first: int
    takes: Mapping[str, tuple[Path, ...]]
    machine: Machine
    tell: Callable[[Progress], None]
    stop: Callable[[], bool]
    compiling: Callable[[], AbstractContextManager[None]]


@dataclass(frozen=True, kw_only=True)
class Made:
    """What has come of a stage.

    Attributes:
        samples: Moments driven, or samples learnt from.
        said: What there is to say of it, in a line.
    """

    samples: int
    said: str


@dataclass(frozen=True, kw_only=True)
class StageKind:
    """A kind of stage.

    Attributes:
        summary: What it does, in a few words.
        settings: A frozen dataclass: the fields that its table in a recipe has.
        makes: What it leaves.
        takes: By field of the settings that names stages: what these must make.
        run: Does it, or goes on with it; None if it was asked to stop before the end.
        drives: Whether it needs numbers of drives.
    """

    summary: str
    settings: type
    makes: Product
    takes: Mapping[str, Product]
    run: Callable[[StageRun], Made | None]
    drives: bool = False


def digest_of(product: Product, folder: Path) -> str:
    """A hash of what a stage has left in its folder; of nothing where there is nothing."""
    digest = hashlib.blake2b(digest_size=16)
    for path in _FILES[product](folder):
        digest.update(str(path.relative_to(folder)).encode())
        digest.update(hashlib.blake2b(path.read_bytes()).digest())
    return digest.hexdigest()


def _policy_files(folder: Path) -> list[Path]:
    """All but the card: it says how long things took."""
    return sorted(path for path in (folder / POLICY_FOLDER).glob("*") if path.suffix != ".md")


_FILES: Mapping[Product, Callable[[Path], list[Path]]] = {
    Product.DRIVES: drive_paths,
    Product.POLICY: _policy_files,
    Product.SEEN: lambda folder: sorted((folder / SEEN_FOLDER).glob("*.npy")),
}
