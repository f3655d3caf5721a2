"""`branch`: a recorded drive goes on from a moment in a changed world."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from leaderboard.api.comparisons import as_run
from leaderboard.api.given_agents import GivenAgent
from leaderboard.api.pages import with_agent
from leaderboard.api.requests import requests
from leaderboard.api.runs import Run
from leaderboard.api.shown import Shown
from leaderboard.pages.markup import Content, element
from leaderboard.replaying.branch import Branch, same_future
from leaderboard.running.displays.work_bar import work_bar

PICTURE = "branch.png"


@dataclass(frozen=True, kw_only=True, repr=False)
class Branched(Shown):
    """Two futures of one moment.

    Attributes:
        futures: The one that was, and the one that would have been.
        run: The latter as a run of its own, beside a picture of both.
    """

    futures: Branch
    run: Run

    @property
    def same(self) -> bool:
        """Whether both are the same, to the bit."""
        return same_future(self.futures.recorded, self.futures.edited)

    @property
    def title(self) -> str:
        """What was changed when, and what it did to the driving score."""
        was, now = self.futures.recorded.score, self.futures.edited.score
        edits = "; ".join(str(edit.to_text()) for edit in self.futures.edits) or "nothing changed"
        return (
            f"Route {self.futures.recorded.route_id} from {self.futures.at_s:g} s with {edits}: "
            f"DS {was.driving_score:.1f} -> {now.driving_score:.1f}; {self.run.folder}"
        )

    def rows(self) -> list[dict[str, Any]]:
        """A row for each future."""
        both = ("as recorded", self.futures.recorded), ("edited", self.futures.edited)
        return [
            {
                "future": name,
                "status": record.status,
                "driving_score": record.score.driving_score,
                "route_completion": record.score.route_completion,
                "infraction_score": record.score.infraction_score,
                "game_s": record.game_s,
            }
            for name, record in both
        ]

    def _beside(self) -> Content:
        picture = base64.b64encode((self.run.folder / PICTURE).read_bytes()).decode()
        return element("img", src=f"data:image/png;base64,{picture}", alt="both futures")


def branch(
    run: Run | Path | str,
    route: str | int,
    at_s: float,
    world: str = "",
    *,
    seed: int = 0,
    agent: GivenAgent | None = None,
    trust: bool = False,
    output: Path | str | None = None,
    overwrite: bool = False,
) -> Branched:
    """Asks what would have happened had the world been another from a moment on.

    Args:
        run: A run, or its folder.
        route: The route's id.
        at_s: Game time at which the world is changed.
        world: What is changed, such as `remove:actor=17`; without, the same comes out again.
        seed: Which of the run's seeds.
        agent: Who drove, where it is not found as the run names it.
        trust: The run's agent and edits may be loaded, even if they are code that is not ours.
        output: Folder for picture and drive; None for a new one in the run's folder.
        overwrite: Replace results that it holds already.

    Raises:
        RequestError: If there is no such route or moment, or an edit cannot be made.
    """
    from di_envs.edits.world import read_world_edits
    from leaderboard.commands.branch import new_folder
    from leaderboard.pages.branch_picture import write_branch_picture
    from leaderboard.records.chosen_route import chosen_route
    from leaderboard.records.own_files import prepare_folder, take_away
    from leaderboard.records.results import write_run
    from leaderboard.replaying.branch import branch as drive_on
    from leaderboard.replaying.branch import branch_run

    with requests():
        edits = read_world_edits(world)
        run = as_run(run, trust=trust)
        record = with_agent(run, agent)
        driven = chosen_route(record, str(route), seed)
        folder = Path(output or new_folder(run.folder, str(route), at_s))
        prepare_folder(folder, overwrite=overwrite)
        with work_bar("branching", "s", transient=True) as bar:
            task = bar.add_task("", total=int(driven.game_s))
            futures = drive_on(
                record,
                driven,
                at_s,
                edits,
                on_step=lambda time_s: bar.update(task, completed=int(time_s)),
            )
        take_away(folder)
        after = branch_run(record, futures)
        write_run(folder, after)
        write_branch_picture(folder / PICTURE, record, futures)
    return Branched(futures=futures, run=Run(record=after, folder=folder, trusted=run.trusted))
