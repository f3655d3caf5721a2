"""What a system of the zoo is set beside: its own runs with a change, then those that are blind."""

from __future__ import annotations

import pytest

from benchmarks.zoo_pairs import beside, row
from leaderboard.scoring.score import Score
from tests.leaderboard.made_records import route, run_of


def driven(agent, *interventions):
    return run_of(route("1"), agent=agent, interventions=interventions, seeds=(0,))


def names(*runs):
    return [
        (run.agent, "; ".join([other.agent, *other.interventions])) for run, other in beside(runs)
    ]


def test_a_system_stands_beside_itself_changed_and_beside_the_blind_ones():
    runs = [
        driven("lbc?rules=off"),
        driven("ego-only"),
        driven("lbc"),
        driven("lbc", "clear:lidar"),
    ]
    assert names(*runs) == [
        ("lbc", "lbc?rules=off"),
        ("lbc", "lbc; clear:lidar"),
        ("lbc", "ego-only"),
    ]


def test_the_blind_ones_stand_beside_nobody_but_themselves_changed():
    assert names(driven("route-only"), driven("ego-only")) == []
    assert names(driven("ego-only"), driven("ego-only", "drop:speed")) == [
        ("ego-only", "ego-only; drop:speed")
    ]


def test_a_difference_is_the_systems_less_the_others_over_what_both_drove():
    def scored(agent, *points):
        records = [
            route("1", seed=seed, score=Score(route_completion=each, infraction_score=1.0))
            for seed, each in enumerate(points)
        ]
        return run_of(*records, agent=agent, seeds=tuple(range(len(points))))

    cells = row(scored("lbc", 80.0, 0.0), scored("lbc?rules=off", 50.0)).strip("| ").split(" | ")
    assert cells[:5] == ["`lbc`", "`lbc?rules=off`", "1", "80.0", "50.0"]
    assert cells[5].startswith("+30.0")


def test_names_that_begin_alike_are_not_one_system():
    runs = [driven("lbc"), driven("lbc-teacher"), driven("lbc-teacher?rules=off")]
    assert names(*runs) == [("lbc-teacher", "lbc-teacher?rules=off")]


@pytest.mark.parametrize(
    ("runs", "says"),
    [
        ([driven("lbc"), driven("lbc")], "two runs of lbc"),
        ([driven("lbc?rules=off")], "without one of lbc as shipped"),
    ],
)
def test_runs_that_cannot_be_told_apart_or_stand_alone_are_refused(runs, says):
    with pytest.raises(ValueError, match=says):
        list(beside(runs))
