"""Lists of what there is to evaluate."""

from __future__ import annotations

import io

from rich.console import Console

from leaderboard.tables.lists import scenario_table


def test_suites_are_listed_with_the_scenarios_that_their_routes_meet() -> None:
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(scenario_table())
    lines = console.export_text().splitlines()
    rows = [[cell.strip() for cell in line.strip("│").split("│")] for line in lines if "│" in line]
    assert [row[0] for row in rows] == ["town05_long", "town05_short"]
    assert all(int(count) > 0 for row in rows for count in row[1:])
    assert all(f"S{number}" in "".join(lines) for number in (1, 3, 4, 7, 8, 9, 10))
