"""Lists of what there is to evaluate."""

from __future__ import annotations

import io

from rich.console import Console

from leaderboard.tables.lists import scenario_table, zoo_table


def test_suites_are_listed_with_the_scenarios_that_their_routes_meet() -> None:
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(scenario_table())
    lines = console.export_text().splitlines()
    rows = [[cell.strip() for cell in line.strip("│").split("│")] for line in lines if "│" in line]
    assert [row[0] for row in rows] == ["town05_long", "town05_short"]
    assert all(int(count) > 0 for row in rows for count in row[1:])
    assert all(f"S{number}" in "".join(lines) for number in (1, 3, 4, 7, 8, 9, 10))


def test_each_system_of_the_zoo_is_listed_with_what_it_is_given_and_its_size() -> None:
    columns = [list(column.cells) for column in zoo_table().columns]
    rows = {row[0]: row[1:] for row in zip(*columns, strict=True)}
    assert len(rows) >= 12
    assert rows["ppo"][1] == "prompt"
    for inputs, size in ((row[1], row[2]) for row in rows.values()):
        assert inputs
        assert int(size.replace(",", "")) > 50_000
