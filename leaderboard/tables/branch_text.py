"""Both futures of a branch as tables: how they ended, and what happened in each, by time."""

from __future__ import annotations

from collections.abc import Iterator

from rich.table import Table

from di_envs.files.shown_text import in_one_line
from leaderboard.records.record import EventRecord, RouteRecord
from leaderboard.replaying.branch import Branch
from leaderboard.scoring.names import EVENT_NAMES


def branch_tables(branch: Branch) -> Iterator[Table]:
    """A table of scores and one of the events after the branch."""
    yield _scores(branch)
    yield _events(branch)


def _titles(branch: Branch) -> tuple[str, str]:
    edits = "; ".join(str(edit.to_text()) for edit in branch.edits)
    return "as recorded", f"with {edits}" if edits else "nothing changed"


def _scores(branch: Branch) -> Table:
    edited = branch.edited
    title = f"Route {edited.route_id}, seed {edited.seed}, branched at {branch.at_s:g} s"
    title = in_one_line(title)
    table = Table("future", "status", "DS", "RC %", "IS", "time s", title=title)
    pairs = zip(_titles(branch), (branch.recorded, edited), strict=True)
    for name, record in pairs:
        score = record.score
        table.add_row(
            name,
            record.status,
            f"{score.driving_score:.2f}",
            f"{score.route_completion:.2f}",
            f"{score.infraction_score:.2f}",
            f"{record.game_s:.1f}",
        )
    return table


def _events(branch: Branch) -> Table:
    """Events after the branch; those that both futures share stand in one row."""
    table = Table("time s", *_titles(branch), title=f"Events after {branch.at_s:g} s")
    one, other = (_after(record, branch.at_s) for record in (branch.recorded, branch.edited))
    for time_s, name in sorted({*one, *other}):
        key = (time_s, name)
        table.add_row(f"{time_s:.2f}", name if key in one else "", name if key in other else "")
    return table


def _after(record: RouteRecord, at_s: float) -> set[tuple[float, str]]:
    return {(event.time_s, _name(event)) for event in record.events if event.time_s > at_s}


def _name(event: EventRecord) -> str:
    other = f" {event.other}" if event.other >= 0 else ""
    met = f" ({event.other_type}{other})" if event.other_type else other
    return f"{EVENT_NAMES[event.kind]}{met}"
