"""The table of a run on a terminal as narrow as they come."""

from __future__ import annotations

import io

from rich.console import Console

from di_envs.world.kinds import EventKind
from leaderboard.scoring.score import Score
from leaderboard.tables.run_tables import print_run
from tests.leaderboard.made_records import event, route, run_of


def test_in_eighty_columns_no_word_of_what_happened_is_broken():
    kinds = (EventKind.COLLISION_VEHICLE, EventKind.OUTSIDE_LANES, EventKind.ROUTE_DEVIATION)
    records = [
        route(
            "town05_long_12",
            seed=seed,
            index=seed,
            score=Score(route_completion=100.0 - 10.0 * seed, infraction_score=0.5),
            events=tuple(event(kind) for kind in kinds),
        )
        for seed in range(3)
    ]
    console = Console(file=io.StringIO(), width=80)
    print_run(run_of(*records, seeds=(0, 1, 2)), console)
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    words = console.file.getvalue().replace("│", " ").split()
    for word in ("town05_long_12", "vehicle", "outside", "lanes,", "45.0", "12.4"):
        assert word in words, console.file.getvalue()
