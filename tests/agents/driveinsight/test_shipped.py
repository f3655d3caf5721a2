"""The policy that comes with the package: whole, of the named configuration, and able to drive."""

from __future__ import annotations

from agents.driveinsight.agent import SHIPPED, requirements_of
from agents.driveinsight.config import config_named
from agents.driveinsight.weights import CARD_FILE, from_pretrained
from leaderboard.running.driver import Driver
from leaderboard.running.jobs import Job, RunSpec


def test_the_shipped_weights_are_of_the_configuration_small():
    assert from_pretrained(SHIPPED).config == config_named("small")


def test_the_shipped_policy_has_a_card_that_says_what_it_is_trained_on_and_what_it_cannot():
    card = (SHIPPED / CARD_FILE).read_text(encoding="utf-8")
    for part in ("## Training", "## Data", "## Scores", "## Limits"):
        assert part in card


def test_the_shipped_policy_drives_a_crossing_to_its_end_twice_to_the_same_bits():
    config = config_named("small")
    spec = RunSpec(agent="driveinsight", options={"suite": "town05_tiny"})
    with Driver(spec, requirements_of(config)) as driver:
        job = Job(index=0, route_id=driver.env.route_ids[0], seed=0)
        first, second = driver.drive(job), driver.drive(job)
    assert not first.crashed
    assert first.score.route_completion == 100.0
    assert first.controls == second.controls
    assert first.state_hash == second.state_hash
