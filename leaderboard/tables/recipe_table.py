"""A recipe's stages as a table: how each stands, how long it took, what came of it."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.table import Table

from agents.training.recipes.running import Standing
from leaderboard.running.displays.recipe import clock


def recipe_table(standings: Sequence[Standing]) -> Table:
    """A row a stage, and their sums; of one that is not done, what it takes."""
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("stage", no_wrap=True)
    table.add_column("state", no_wrap=True)
    table.add_column("samples", justify="right", no_wrap=True)
    table.add_column("what came of it, or what it takes")
    spent_s, samples = 0.0, 0
    for standing in standings:
        stage, marker = standing.stage, standing.marker
        state, seen, said = standing.state, "", f"{stage.kind}: {', '.join(stage.named)}"
        if marker is not None:
            spent_s, samples = spent_s + marker.spent_s, samples + marker.samples
            state = f"{state} {clock(marker.spent_s)}"
            if marker.done:
                seen, said = f"{marker.samples:,}", marker.said
        table.add_row(stage.name, state, seen, said)
    table.add_section()
    table.add_row("all", clock(spent_s), f"{samples:,}", "")
    return table
