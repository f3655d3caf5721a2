"""What the leaderboard's records say comes out again: a route of each is driven anew."""

from __future__ import annotations

import pytest

import driveinsight
from agents.versions import agent_packages
from di_envs.numerics.kernels import cpu_capability
from docs.scripts.leaderboard_page import column, read_records

RECORDS = read_records()


@pytest.mark.full
@pytest.mark.parametrize("place", RECORDS)
def test_a_route_of_every_record_drives_as_it_did(place, tmp_path):
    record = RECORDS[place]
    if agent_packages(record["agent"]) and record["cpu"] != cpu_capability():
        pytest.skip(f"networks add up in another order than on the record's CPU, {record['cpu']}")
    shortest = min(range(len(record["routes"])), key=column(record, "km").__getitem__)
    route, seed, *expected = record["routes"][shortest]
    run = driveinsight.evaluate(
        record["agent"], record["suite"], seeds=[seed], routes=[route], output=tmp_path / "run"
    )
    (driven,) = run.record.routes
    score = driven.score
    found = [score.driving_score, score.route_completion, score.infraction_score]
    assert found == pytest.approx(expected[:3], abs=1e-4)
    assert driven.done_m / 1000.0 == pytest.approx(expected[4], abs=1e-4)
