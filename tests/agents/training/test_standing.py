"""Who stands for what is hidden is not learnt from; who drives, or knows why it stands, is."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from agents.driveinsight.config import BEV, TOKENS, config_named
from agents.driveinsight.losses import Targets
from agents.training.standing import FOR, stands_for
from agents.training.trainees import PaperTrainee
from di_envs.town.lanes import LightState
from tests.agents.training.test_turned_red import before_a_light

SOMEBODY, LIGHT, SIGN = np.eye(3, dtype=bool)
NOTHING = np.zeros(3, bool)
STAYS = np.zeros(8)


def standing(**changes):
    """One moment 3.1 m before a light, standing and staying."""
    at = {"line_m": 3.1, "speed": 0.0, "ways": STAYS, "state": LightState.RED} | changes
    return before_a_light(**at)


def at_a_sign(came_mps):
    moment = standing(line_m=60.0)
    moment["stop_signs"][:, 0] = moment["traffic_lights"][:, 0, [0, 1, 2, 4]]
    moment["stop_signs"][:, 0, 0] = 3.1
    moment["speed_history"][:] = came_mps
    return moment


def reason(moments):
    (found,) = stands_for(moments, moments["valid"] > 0)
    return found


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, LIGHT),
        ({"state": LightState.YELLOW}, LIGHT),
        ({"state": LightState.GREEN}, SOMEBODY),
        ({"line_m": 15.0}, SOMEBODY),
        ({"speed": 1.0}, LIGHT),  # it comes to a stand
        ({"speed": 1.0, "line_m": 15.0}, SOMEBODY),
        ({"ways": np.arange(1, 9) * 0.5}, NOTHING),
    ],
)
def test_at_a_line_one_stands_for_its_light_and_elsewhere_for_somebody(changes, expected):
    assert (reason(standing(**changes)) == expected).all()


def test_at_a_sign_one_stands_for_it_while_one_has_only_come():
    assert (reason(at_a_sign(2.0)) == SIGN).all()
    assert (reason(at_a_sign(0.0)) == SOMEBODY).all()


@pytest.mark.parametrize(
    ("name", "hidden", "reason_of", "learnt"),
    [
        ("driveinsight", (), "obstacles", True),
        ("driveinsight", ("obstacles",), "obstacles", True),  # it sees
        ("driveinsight", ("obstacles", BEV), "obstacles", False),
        ("driveinsight", ("obstacles", BEV), "traffic_lights", True),
        ("driveinsight", ("traffic_lights", BEV), "traffic_lights", False),
        ("driveinsight-sensors", (BEV,), "traffic_lights", False),  # which it is never told
        ("driveinsight-told", ("obstacles",), "obstacles", False),  # it never sees
        ("route-only", (), "stop_signs", False),
    ],
)
def test_who_stands_for_what_is_hidden_is_not_learnt_from(name, hidden, reason_of, learnt):
    given = torch.tensor([[float(token not in hidden) for token in TOKENS]]).repeat(2, 1)
    stands = torch.tensor([[float(each == reason_of) for each in FOR], [0.0, 0.0, 0.0]])
    targets = Targets(waypoints=torch.ones(2, 8, 2), valid=torch.ones(2, 8), stands_for=stands)
    known = PaperTrainee(config_named(name))._known(targets, given)
    assert known.valid.tolist() == [[float(learnt)] * 8, [1.0] * 8]
