"""The policies that come with the package: whole, of the named configuration, and able to drive."""

from __future__ import annotations

import pytest

from agents import AGENTS, AgentSpecError, load_agent
from agents.driveinsight.agent import SHIPPED, requirements_of
from agents.driveinsight.config import config_named
from agents.driveinsight.weights import from_pretrained
from agents.networks.weights import CARD_FILE, WEIGHTS_FILE
from leaderboard.running.driver import Driver
from leaderboard.running.jobs import Job, RunSpec

NAMES = [name for name, entry in AGENTS.items() if entry.data.startswith("driveinsight/weights/")]
MOST_BYTES = 4_000_000
# Of other drives, or of fewer samples
TRAINED_AS = {"driveinsight-town05": "driveinsight", "driveinsight-budget": "driveinsight"}
# Drives of networks that another drives already, with other weights
AGAIN = ("driveinsight-sensors", "driveinsight-town05", "driveinsight-budget")
DRIVEN = [pytest.param(name, marks=pytest.mark.full) if name in AGAIN else name for name in NAMES]


@pytest.fixture(params=NAMES)
def shipped(request):
    return request.param


def test_each_shipped_agent_reads_the_folder_of_its_name():
    for name in NAMES:
        assert AGENTS[name].data == f"driveinsight/weights/{name}"
        assert AGENTS[name].options == {"shipped": name}
        config_named(TRAINED_AS.get(name, name))


def test_a_policy_that_does_not_come_with_the_package_says_what_to_do():
    with pytest.raises(AgentSpecError, match=r"'nobody': this version comes without .* Train some"):
        load_agent("agents.driveinsight.agent:DriveInsightAgent", shipped="nobody")


def test_shipped_weights_are_small_and_of_the_configuration_of_their_name(shipped):
    config = config_named(TRAINED_AS.get(shipped, shipped))
    assert from_pretrained(SHIPPED / shipped).config == config
    assert (SHIPPED / shipped / WEIGHTS_FILE).stat().st_size <= MOST_BYTES


def test_a_shipped_policy_has_a_card_that_says_what_it_is_trained_on_and_what_it_cannot(shipped):
    card = (SHIPPED / shipped / CARD_FILE).read_text(encoding="utf-8")
    for part in ("## Training", "## Data", "## Scores", "## Limits"):
        assert part in card


@pytest.mark.parametrize("shipped", DRIVEN)
def test_a_shipped_policy_drives_a_crossing_to_its_end_twice_to_the_same_bits(shipped):
    spec = RunSpec(agent=shipped, options={"suite": "town05_tiny"})
    with Driver(spec, requirements_of(from_pretrained(SHIPPED / shipped).config)) as driver:
        job = Job(index=0, route_id=driver.env.route_ids[0], seed=0)
        first, second = driver.drive(job), driver.drive(job)
    assert not first.crashed
    assert first.controls == second.controls
    assert first.state_hash == second.state_hash
