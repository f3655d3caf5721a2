"""The zoo's order beside the paper's: which systems are compared, and how sure the figure is."""

from __future__ import annotations

import math
import re

import pytest

from benchmarks.samples_seen import samples_seen
from benchmarks.zoo_table import BRIEF, HEADER, TABLE_1, cost_of, main, rank_line, success_rate
from di_envs.world.kinds import EventKind
from docs.scripts.leaderboard_page import record_of
from leaderboard.scoring.score import Score
from tests.leaderboard.made_records import event, route, run_of

PAPER = (
    "st-p3",
    "lbc",
    "vad",
    "transfuser",
    "driveinsight-town05",
    "interfuser",
)  # on Long, upwards


def driven(name, scores):
    """The record of a run on Long with so many points on each route."""
    records = [
        route(str(index), index=index, score=Score(route_completion=score, infraction_score=1.0))
        for index, score in enumerate(scores)
    ]
    return record_of(run_of(*records, agent=name, seeds=(0,)))


def line(points):
    """What is said of systems with these points on each route, in the paper's order upwards."""
    found = {
        name: {"town05_long": driven(name, each)} for name, each in zip(PAPER, points, strict=True)
    }
    return rank_line("town05_long", found)


def numbers(text):
    return [float(each) for each in re.findall(r"[-+]\d\.\d\d", text)]


def test_the_papers_order_is_one_and_the_other_way_round_is_minus_one():
    assert [TABLE_1[name].ds("town05_long") for name in PAPER] == sorted(
        TABLE_1[name].ds("town05_long") for name in PAPER
    )
    points = [[10.0 * n, 10.0 * n + 5.0] * 5 for n in range(1, 7)]
    assert numbers(line(points))[0] == 1.0
    assert numbers(line(points[::-1]))[0] == -1.0


def test_two_that_change_places_cost_what_spearman_says_and_the_interval_is_fishers():
    points = [[score] * 10 for score in (20.0, 10.0, 30.0, 40.0, 50.0, 60.0)]
    rho = 1.0 - 6.0 * 2.0 / (6.0 * 35.0)  # two ranks are one off
    value, low, high, from_, to = numbers(line(points))
    assert value == pytest.approx(rho, abs=0.005)
    assert low == high == value, "routes that are all alike say the same however they are drawn"
    spread = 1.96 * math.sqrt(1.06 / 3.0)
    assert from_ == pytest.approx(math.tanh(math.atanh(rho) - spread), abs=0.005)
    assert to == pytest.approx(math.tanh(math.atanh(rho) + spread), abs=0.005)


def test_an_order_that_hangs_on_few_routes_is_not_sure():
    steady = [[10.0 * n] * 10 for n in range(1, 6)]
    _, low, high, *_ = numbers(line([[0.0] * 8 + [100.0] * 2, *steady]))
    assert low < high


def test_other_routes_cannot_be_told_where_systems_drove_different_ones():
    found = {
        name: {"town05_long": driven(name, [10.0 * n] * (10 + n))} for n, name in enumerate(PAPER)
    }
    assert "the records are not of the same routes" in rank_line("town05_long", found)


def test_a_system_that_the_paper_has_twice_or_not_at_all_is_not_compared():
    names = ("lbc", "mile", "ppo", "driveinsight")
    found = {name: {"town05_long": driven(name, [50.0])} for name in names}
    assert "2 systems are in both: too few" in rank_line("town05_long", found)


def test_a_success_is_a_whole_route_without_a_scored_infraction():
    half = route("2", score=Score(route_completion=50.0, infraction_score=1.0))
    run_red = Score(route_completion=100.0, infraction_score=0.7)
    red = route("3", score=run_red, events=(event(EventKind.RED_LIGHT, other=3),))
    record = record_of(run_of(route("1"), half, red, route("4"), seeds=(0,)))
    assert success_rate(record) == 50.0


def test_samples_seen_are_of_all_stages_whose_weights_it_begins_with():
    pictures, planned = samples_seen("driveinsight")
    assert pictures == (5_000 + 2_000) * 5 * 4, "two stages of eyes, sequences of four moments"
    assert planned == (8_000 + 4 * 5_000 + 2 * 8_000) * 128, "fresh, four rounds, joined, last"
    assert samples_seen("mile") == (3_750 * 16, 0)
    assert samples_seen("driveadapter") == (2 * 3_750 * 16, 0), "its teacher's, too"
    assert samples_seen("ppo") is None, "it learns from reward"


def test_an_agent_that_a_record_names_by_its_file_is_not_run(tmp_path):
    (tmp_path / "mine.py").write_text(f"open({str(tmp_path / 'run')!r}, 'w')\n")
    assert cost_of(f"{tmp_path / 'mine.py'}:Mine") == ["-", "-"]
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("name", ["route-only", "ego-only", "ppo"])
def test_policies_systems_and_what_stable_baselines_learned_have_a_cost(name):
    size, spent_ms = cost_of(name)
    assert 50_000 < int(size.replace(",", "")) < 2_000_000
    assert spent_ms.isdigit(), "whole milliseconds, 0 for the smallest"


def test_the_readmes_table_is_of_columns_of_the_large_one(capsys, monkeypatch):
    records = {
        "short": {**driven("constant", [50.0]), "suite": "town05_short"},
        "long": driven("ego-only", [50.0]),
    }
    monkeypatch.setattr("benchmarks.zoo_table.read_records", lambda: records)
    monkeypatch.setattr("sys.argv", ["zoo_table", "--brief"])
    main()
    head, _, row, *rest = capsys.readouterr().out.splitlines()
    assert "constant" not in "".join([row, *rest]), "it is no network"
    cells = dict(zip(head.split(" | "), row.split(" | "), strict=True))
    assert set(BRIEF) <= set(HEADER)
    assert cells["Long DS"] == "50.0"
    assert cells["Short DS"] == "-"


def test_who_is_no_network_has_no_cost():
    assert cost_of("constant") == ["-", "-"]
