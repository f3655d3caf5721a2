"""What a learner is not told: by drive, in the shares asked for, as dropout hides it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from agents import load_agent
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import save_pretrained
from agents.training.collect import DriveJob, drive_job
from agents.training.frames import DriveFileError, read_drive
from agents.training.hiding import EVERYTHING, Hiding, components_of, told_less
from di_envs.prompt import COMPONENTS
from tests.agents.training.learners import Idle
from tests.agents.training.small_policies import SEEING

PRIVILEGED = ("map", "obstacles", "traffic_lights", "stop_signs")


class Attentive(Idle):
    """Says what it was told."""

    def act(self, observation, memory):
        return super().act(observation, memory)[0], observation["prompt_present"].tolist()


def test_parts_are_components_groups_or_several_of_them():
    assert components_of("speed") == ("speed",)
    assert components_of("privileged") == PRIVILEGED
    assert components_of("privileged+bev") == (*PRIVILEGED, "bev")
    assert components_of("map+privileged") == PRIVILEGED


def test_drives_are_driven_in_the_shares_asked_for_and_each_number_alike():
    hiding = Hiding.of({"privileged": 0.3, "bev": 0.1})
    drawn = [hiding.hidden_in("small_grid", number) for number in range(500)]
    share = {parts: drawn.count(parts) / 500 for parts in set(drawn)}
    assert share == pytest.approx({PRIVILEGED: 0.3, ("bev",): 0.1, (): 0.6}, abs=0.08)
    assert drawn[:50] == [hiding.hidden_in("small_grid", number) for number in range(50)]
    assert drawn[:50] != [hiding.hidden_in("suburb", number) for number in range(50)]
    assert EVERYTHING.hidden_in("small_grid", 7) == ()


@pytest.mark.parametrize(
    ("shares", "message"),
    [
        ({"obstacle": 0.1}, "did you mean 'obstacles'"),
        ({"map": -0.1}, "share of drives without map is 0 to 1, not -0.1"),
        ({"map": 0.6, "bev": 0.6}, "1 together at most, not 1.2"),
    ],
)
def test_shares_that_make_no_sense_are_refused(shares, message):
    with pytest.raises(ValueError, match=message):
        Hiding.of(shares)


def test_what_is_hidden_is_marked_as_not_given_and_nothing_else_is_changed():
    seen = {"prompt_present": np.ones(9, np.int8), "speed": np.array([3.0])}
    _, told = told_less(Attentive(), ("map", "speed")).act(seen, None)
    assert told == [float(name not in ("map", "speed")) for name in COMPONENTS]
    assert seen["prompt_present"].all()
    agent = Attentive()
    assert told_less(agent, ()) is agent


def test_a_learner_without_eyes_has_no_bev_to_hide():
    with pytest.raises(ValueError, match=r"bev cannot be hidden .* Attentive has no"):
        told_less(Attentive(), ("bev",))


def test_a_drive_says_what_was_hidden_in_it_and_its_folder_how_often(tmp_path):
    job = DriveJob(
        folder=tmp_path,
        town="small_grid",
        number=0,
        driver="tests.agents.training.learners:Timid",
        hiding=Hiding.of({"privileged": 1.0}),
    )
    drive_job(job)
    facts = read_drive(job.path).facts
    assert facts["hidden"] == list(PRIVILEGED)
    assert facts["hiding"] == {"privileged": 1.0}
    other = DriveJob(folder=tmp_path, town="small_grid", number=0, driver=job.driver)
    with pytest.raises(DriveFileError, match=r"hiding 'privileged' was 1\.0, is not given"):
        drive_job(other)


@pytest.mark.parametrize("scheme", ["driveinsight:{}", "true-sight:{}?eyes=blurred"])
def test_a_learner_with_eyes_its_own_or_lent_loses_what_it_sees(scheme, tmp_path):
    torch.manual_seed(0)
    save_pretrained(Policy(SEEING), tmp_path, "untrained")
    agent = load_agent(scheme.format(tmp_path))
    blind = told_less(agent, ("obstacles", "bev"))
    assert blind.requires == agent.requires
    assert [str(edit.tap) for edit in blind._agent._edits] == ["bev.tokens"]
    assert agent._edits == ()  # which stays as it was
