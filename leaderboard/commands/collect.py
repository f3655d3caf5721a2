"""`driveinsight collect`: the expert drives training towns, and its drives are kept as states."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro
from rich.table import Table

from leaderboard.commands.ending import EXIT_INTERRUPTED, UsageError, say, typed
from leaderboard.commands.scene_arguments import says
from leaderboard.commands.trusting import check_model
from leaderboard.running.terminal import Terminal

if TYPE_CHECKING:
    from agents.processes import Pool
    from agents.training.collect import DriveJob, Outcome
    from agents.training.hiding import Hiding

COLLECT_HELP = """Let the expert drive in made-up towns, and keep what it did, to train policies on.

Examples:
  driveinsight collect --frames 20000
  driveinsight collect --towns small_grid suburb --frames 5000 --workers 2 --output data
  driveinsight collect --frames 1000000 --engine ray --workers 64 --address auto

Kept are states, not pictures: about 1 kB each half second. Cameras and LiDAR are rendered from them
while a policy is trained. Towns: small_grid, large_grid, suburb, highways, rural, downtown, mixed;
all by default, and Town05 is not among them: name it (town05) to have drives of it, too, over
routes that are no suite's. After Ctrl-C the same command goes on; with more --frames it adds to
what is there. Drives with an infraction are dropped."""


@dataclass(frozen=True, kw_only=True)
class Collect:
    """The arguments of `driveinsight collect`."""

    frames: Annotated[int, says("N", "20000")] = 20000
    """Moments to have in all, half a second apart; each town gets its share."""

    towns: Annotated[tuple[str, ...], says("NAME ...", "all seven")] = ()
    """Towns to drive in: training towns, or town05."""

    workers: Annotated[int, says("N", "1")] = 1
    """Drives at the same time; the files are the same for any number."""

    engine: Annotated[Literal["local", "ray"], says("local|ray", "local")] = "local"
    """Where: on this machine, or on a Ray cluster (needs driveinsight[ray]); the same files, and
    they come here."""

    address: Annotated[str | None, says("ADDRESS", "a cluster of this machine alone")] = None
    """With --engine ray: a running cluster, such as `auto` or ray://head:10001."""

    driver: Annotated[str, says("AGENT", "expert")] = "expert"
    """Who drives. With another agent, such as driveinsight:runs/small/policy, what is kept is what
    the expert would have done from each moment of its drives: corrections of its mistakes."""

    hidden: Annotated[tuple[str, ...], says("PART=SHARE ...", "nothing")] = ()
    """With --driver: share of the drives in which it is not told something, such as privileged=0.3
    (map, obstacles, lights and signs) speeds=0.1 obstacles+bev=0.1."""

    first: Annotated[int, says("N", "0")] = 0
    """Number of each town's first drive; it says route and seed. Begin where earlier drives ended,
    and a learner is corrected in places that it has not been trained on."""

    trust: tyro.conf.FlagCreatePairsOff[bool] = False
    """Load a --driver's file that holds pickles (sb3:), which runs the code in them."""

    output: Annotated[Path, says("DIR", "data")] = Path("data")
    """Folder for the drives of this driver."""

    def run(self) -> int:
        """Collects; returns the exit code."""
        if self.frames < 1 or self.workers < 1:
            raise UsageError("--frames and --workers must be at least 1")
        if self.first < 0:
            raise UsageError("--first must not be negative")
        if self.address and self.engine != "ray":
            raise UsageError("--address is of a Ray cluster: add --engine ray")
        check_model(self.driver, trust=self.trust)

        from agents.training.collect import compile_for_drives
        from agents.training.data_card import CARD_FILE, data_card
        from agents.training.frames import FRAME_S, DriveFileError
        from agents.training.hiding import Hiding
        from agents.training.town_styles import TRAINING_TOWNS
        from agents.training.towns import KNOWN_TOWNS
        from di_envs.config import check_name
        from di_envs.files.json_text import indented
        from di_envs.files.whole import write_whole
        from leaderboard.running.compiling import compile_progress
        from leaderboard.running.jobs import SetupError

        towns = tuple(dict.fromkeys(self.towns or TRAINING_TOWNS))
        try:
            for town in towns:
                check_name(town, KNOWN_TOWNS, "training town")
            hiding = Hiding.of(self._hidden())
            with compile_progress(Terminal(stderr=True)):
                compile_for_drives(towns[0])
            complete = self._collect(towns, hiding)
            card = data_card(self.output)
        except (ValueError, OSError, DriveFileError, SetupError) as error:
            raise UsageError(str(error)) from error
        write_whole(self.output / CARD_FILE, indented(card))
        say(f"{card['drives']} drives with {card['moments']} moments, {FRAME_S} s apart.")
        say(f"Weather: {card['weather']}.")
        Terminal().print(card_table(card))
        if not complete:
            say("Stopped; what was driven is kept.", "Next: the same command again goes on")
            return EXIT_INTERRUPTED
        say(
            f"Written: {self.output / CARD_FILE} and a file for each drive beside it.",
            f"Next: driveinsight train --config driveinsight --data {typed(self.output)}",
        )
        return 0

    def _pool(self) -> AbstractContextManager[Pool[DriveJob, Outcome]] | None:
        """The cluster; None for processes of this machine."""
        if self.engine == "local":
            return None
        from leaderboard.running.workers.ray_collect import ray_pool

        return ray_pool(self.workers, self.address)

    def _hidden(self) -> dict[str, float]:
        """The shares by name.

        Raises:
            UsageError: If one is no number.
        """
        shares = dict[str, float]()
        for text in self.hidden:
            name, _, share = text.partition("=")
            try:
                shares[name] = float(share)
            except ValueError as error:
                raise UsageError(f"--hidden is PART=SHARE, such as map=0.1, not {text}") from error
        if shares and self.driver == "expert":
            raise UsageError("--hidden is of a learner, which is told things: add --driver AGENT")
        return shares

    def _collect(self, towns: tuple[str, ...], hiding: Hiding) -> bool:
        """Drives; returns whether all is there."""
        from agents.training.collect import collect, share_of
        from leaderboard.running.displays.work_bar import work_bar
        from leaderboard.running.interruption import interruptible

        total = share_of(self.frames, towns) * len(towns)
        began_s, driven = time.monotonic(), 0
        outcomes = collect(
            self.output,
            towns,
            self.frames,
            driver=self.driver,
            hiding=hiding,
            first=self.first,
            workers=self.workers,
            pool=self._pool(),
        )
        with (
            interruptible(ends_process=True) as interruption,
            work_bar("driving", "moments") as bar,
            closing(outcomes),
        ):
            task = bar.add_task("", total=total)
            for outcome in outcomes:
                driven += outcome.moments if outcome.fresh else 0
                rate = driven / (time.monotonic() - began_s)
                about = f"{rate:.0f}/s  {outcome.job.town}"
                bar.update(task, advance=outcome.moments, description=about)
                if interruption.requested:
                    return False
        return True


def card_table(card: Mapping[str, Any]) -> Table:
    """What a folder of drives holds."""
    table = Table()
    table.add_column("of")
    table.add_column("")
    table.add_column("count", justify="right")
    table.add_column("share", justify="right")
    parts = {
        "town": "by_town",
        "command": "by_command",
        "scenario": "by_scenario",
        "dropped drives": "dropped",
    }
    for title, key in parts.items():
        counts = card[key]
        total = sum(counts.values())
        for row, (name, count) in enumerate(counts.items()):
            share = f"{100 * count / total:.0f} %"
            table.add_row("" if row else title, str(name), str(count), share)
        table.add_section()
    return table
