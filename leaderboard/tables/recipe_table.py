"""A recipe's stages as a table: what each takes, how it stands, what it took, what came of it."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from agents.training.recipes.running import Standing
from leaderboard.running.displays.recipe import clock


def recipe_table(standings: Sequence[Standing]) -> Table:
    """A row a stage, and their sums."""
    table = Table()
    table.add_column("stage", no_wrap=True)
    table.add_column("kind", no_wrap=True)
    table.add_column("takes")
    table.add_column("state", no_wrap=True)
    table.add_column("time", justify="right", no_wrap=True)
    table.add_column("samples", justify="right", no_wrap=True)
    table.add_column("what came of it")
    spent_s, samples = 0.0, 0
    for standing in standings:
        stage, marker = standing.stage, standing.marker
        row = [stage.name, stage.kind, ", ".join(stage.named), standing.state]
        if marker is not None:
            spent_s, samples = spent_s + marker.spent_s, samples + marker.samples
            seen = f"{marker.samples:,}" if marker.done else ""
            row += [clock(marker.spent_s), seen, marker.said]
        table.add_row(*row)
    table.add_section()
    table.add_row("all", "", "", "", clock(spent_s), f"{samples:,}", "")
    return table
