"""Stages that drive: the expert's own drives, and corrections of a policy's."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from typing import Literal

from agents.training.collect import EXPERT, collect, compile_for_drives, share_of
from agents.training.data_card import CARD_FILE, data_card
from agents.training.hiding import EVERYTHING, Hiding
from agents.training.recipes.kinds import POLICY_FOLDER, Made, Progress, StageRun
from agents.training.town_styles import TRAINING_TOWNS
from agents.training.towns import KNOWN_TOWNS
from agents.training.trainees import driver_of
from di_envs.files.json_text import indented
from di_envs.files.names import check_name
from di_envs.files.whole import write_whole


@dataclass(frozen=True, kw_only=True)
class CollectStage:
    """The expert drives.

    Attributes:
        frames: Moments in all, half a second apart; each town gets its share.
        towns: Where.
    """

    frames: int
    towns: tuple[str, ...] = tuple(TRAINING_TOWNS)

    def __post_init__(self) -> None:
        _check_driving(self.frames, self.towns)


@dataclass(frozen=True, kw_only=True)
class CorrectStage:
    """A policy drives, and the expert shows what it would have done.

    Attributes:
        learner: Stage whose policy drives.
        frames: Moments in all; each town gets its share.
        eyes: Its own, or those of the simulator, `perfect` or `blurred` as in training: with these
            nothing is rendered.
        towns: Where.
        hidden: Share of the drives in which components are hidden from it, by their names; see
            `Hiding`.
    """

    learner: str
    frames: int
    eyes: Literal["own", "perfect", "blurred"] = "own"
    towns: tuple[str, ...] = tuple(TRAINING_TOWNS)
    hidden: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_driving(self.frames, self.towns)
        Hiding.of(self.hidden)


def _check_driving(frames: int, towns: tuple[str, ...]) -> None:
    if frames < 1:
        raise ValueError(f"frames must be at least 1, not {frames}")
    if not towns:
        raise ValueError("towns is empty; leave it out for all training towns")
    for town in towns:
        check_name(town, KNOWN_TOWNS, "training town")


def run_collect(run: StageRun) -> Made | None:
    """The expert drives until each town has its share."""
    settings: CollectStage = run.settings
    return _drive(run, settings.towns, settings.frames, EXPERT, EVERYTHING)


def run_correct(run: StageRun) -> Made | None:
    """The policy drives until each town has its share of corrections."""
    settings: CorrectStage = run.settings
    policy = run.takes["learner"][0] / POLICY_FOLDER
    own = settings.eyes == "own"
    driver = driver_of(policy) if own else f"true-sight:{policy}?eyes={settings.eyes}"
    return _drive(run, settings.towns, settings.frames, driver, Hiding.of(settings.hidden))


def _drive(
    run: StageRun, towns: tuple[str, ...], frames: int, driver: str, hiding: Hiding
) -> Made | None:
    with run.compiling():
        compile_for_drives(towns[0])
    called = driver.replace(f"{run.folder.parent}/", "")  # the same wherever the recipe is run
    total, kept, driven, began_s = share_of(frames, towns) * len(towns), 0, 0, time.monotonic()
    outcomes = collect(
        run.folder,
        towns,
        frames,
        driver=driver,
        called=called,
        hiding=hiding,
        first=run.first,
        workers=run.machine.workers,
    )
    with closing(outcomes):
        for outcome in outcomes:
            kept += outcome.moments
            driven += outcome.moments if outcome.fresh else 0
            rate = driven / (time.monotonic() - began_s)
            about = f"{rate:.0f}/s  {outcome.job.town}"
            run.tell(Progress(done=kept, total=total, unit="moments", about=about))
            if run.stop():
                return None
    card = data_card(run.folder)
    write_whole(run.folder / CARD_FILE, indented(card))
    dropped = sum(card["dropped"].values())
    said = f"{card['moments']} moments in {card['drives']} drives, {dropped} dropped"
    return Made(samples=card["moments"], said=said)
