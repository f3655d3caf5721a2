"""What went wrong in a run, by kind: how often, and the first of each kind from above.

driveinsight evaluate --agent driveinsight --suite town05_long
python benchmarks/failures.py results/driveinsight-town05_long --picture failures.jpg
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro
from PIL import Image, ImageDraw, ImageFont

from di_envs.course import load_course
from di_envs.drawing.view import MAP_PX, Renderer
from di_envs.rules import rules_named
from di_envs.world.event_names import EVENT_NAMES
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.records.results import read_run
from leaderboard.replaying.replay import replay, replay_env

BEFORE_S = (3.0, 1.5, 0.0)  # moments before an infraction that are shown
PANEL_PX, TITLE_PX, GAP_PX = 300, 26, 6


@dataclass(frozen=True, kw_only=True)
class Failures:
    """Which run to look at."""

    run: tyro.conf.Positional[Path]
    """Folder of results."""

    picture: Path | None = None
    """Where to draw the first of each kind."""


@dataclass(frozen=True, kw_only=True)
class Failure:
    """An infraction: which route, and when."""

    record: RouteRecord
    time_s: float
    words: str


def failures_of(run: RunRecord) -> Mapping[str, Sequence[Failure]]:
    """All infractions that the run's rules count, by kind, the most frequent first."""
    scored = rules_named(run.rules).scored
    found: dict[str, list[Failure]] = defaultdict(list)
    for record in run.routes:
        for event in record.events:
            if event.kind in scored:
                kind = EVENT_NAMES[event.kind]
                words = f"{kind} {event.other_type}".rstrip()
                found[kind].append(Failure(record=record, time_s=event.time_s, words=words))
    return dict(sorted(found.items(), key=lambda item: -len(item[1])))


def moments(run: RunRecord, record: RouteRecord, times_s: Sequence[float]) -> Iterator[Any]:
    """The streets around the ego at moments of a recorded route, in their order."""
    env = replay_env(run)
    renderer = Renderer(load_course(env.config.changes()))
    wanted = list(times_s)
    edge = (MAP_PX - PANEL_PX) // 2
    for step in replay(run, record, env=env):
        if wanted and step.time_s >= wanted[0] - 1e-6:
            wanted.pop(0)
            yield renderer.map(step.view).crop((edge, edge, edge + PANEL_PX, edge + PANEL_PX))


def draw(run: RunRecord, kinds: Mapping[str, Sequence[Failure]]) -> Any:
    """A row for the first infraction of each kind."""
    width, height = len(BEFORE_S) * (PANEL_PX + GAP_PX), PANEL_PX + TITLE_PX
    picture = Image.new("RGB", (width, len(kinds) * height), "#ffffff")
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(15)
    for row, failures in enumerate(kinds.values()):
        first = failures[0]
        title = f"{first.words}: route {first.record.route_id}, {first.time_s:.1f} s; "
        shown = ", ".join(f"{before:g} s before" if before else "then" for before in BEFORE_S)
        pen.text((GAP_PX, row * height + 4), title + shown, "#1d2126", font)
        times_s = [max(first.time_s - before, 0.0) for before in BEFORE_S]
        for column, image in enumerate(moments(run, first.record, times_s)):
            picture.paste(image, (column * (PANEL_PX + GAP_PX), row * height + TITLE_PX))
    return picture


def main(arguments: Failures) -> None:
    """Prints the counts; draws the first of each kind."""
    run = read_run(arguments.run)
    kinds = failures_of(run)
    for kind, failures in kinds.items():
        places = [f"{f.record.route_id} at {f.time_s:.1f} s" for f in failures[:4]]
        print(f"{kind:18} {len(failures):4}   route {', '.join(places)}")
    if arguments.picture and kinds:
        draw(run, kinds).save(arguments.picture)
        print(f"Written: {arguments.picture}")


if __name__ == "__main__":
    main(tyro.cli(Failures, description=__doc__))
