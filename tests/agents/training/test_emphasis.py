"""What is rare is shown more often, what nobody foresees is not learnt, speeds are told wrong."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from agents.training.caching import cached
from agents.training.config import RENDERED, TrainConfig
from agents.training.emphasis import Emphasis, cumulated, meant
from agents.training.loading import Samples
from agents.training.moments import load_moments
from agents.training.trainees import config_named
from agents.zoo.raster import GRID

TRAINING = TrainConfig(steps=40, batch=4, **RENDERED)
EGO_ONLY = config_named("ego-only")


@pytest.fixture(scope="module")
def moments(drives):
    return load_moments([drives], standing_share=0.3)


@pytest.fixture(scope="module")
def emphasis(moments, tmp_path_factory):
    rows = cached(moments, GRID, tmp_path_factory.mktemp("cache")).rows
    return Emphasis.of(rows, TRAINING.interest)


def test_a_moment_is_meant_as_often_as_its_weight_says():
    found = meant(cumulated(np.array([1.0, 0.0, 3.0])), (np.arange(1000) + 0.5) / 1000)
    assert np.bincount(found).tolist() == [250, 0, 750]
    assert meant(cumulated(np.ones(2)), np.array([1.0])).tolist() == [1]


def test_rare_moments_are_shown_more_often_than_they_are_there(moments, emphasis):
    rare = emphasis.weights > 4.0
    assert 0.0 < rare.mean() < 0.5
    samples = Samples(EGO_ONLY, TRAINING, moments, emphasis)
    asked = list[int]()
    samples._sample = lambda row, *_: asked.append(row)  # type: ignore[assignment]
    for number in range(len(samples)):
        samples[number]
    share = rare @ emphasis.weights / emphasis.weights.sum()
    assert rare[asked].mean() == pytest.approx(share, abs=4.0 * np.sqrt(0.25 / len(asked)))
    assert share > 1.5 * rare.mean()


def moving(samples, moments):
    """A drive and its moment at which the ego moves."""
    for row in range(0, len(moments), 5):
        drive, number = samples._drive(int(moments.drive[row])), int(moments.moment[row])
        if drive.speeds()[number] > 3.0 and len(drive.future(number)) >= 4:
            return drive, number
    raise AssertionError("nobody moves")


def test_what_cannot_be_foreseen_is_no_target_and_an_action_waits_for_it(moments, emphasis):
    samples = Samples(config_named("roach-raster"), TRAINING, moments, emphasis)
    drive, number = moving(samples, moments)
    renderer = samples._renderer(drive)
    given = {"variation": TRAINING.varied, "key": 3, "past": 0}
    far = np.arange(8) < 2
    whole, near, nothing = (
        renderer.sample(drive, number, known=known, **given).targets
        for known in (None, far, np.zeros(8, bool))
    )
    assert whole["valid"].all()
    assert near["valid"][0].tolist() == [1, 1, 0, 0]
    assert torch.equal(near["waypoints"], whole["waypoints"])
    assert torch.equal(near["action"], whole["action"])
    assert nothing["action"][0, 0] < 0.0 < whole["action"][0, 0]


def test_each_sample_has_its_own_moments_waypoints_that_can_be_foreseen(moments, emphasis):
    row = int(np.flatnonzero(~emphasis.known[:, :4].all(axis=1))[0])
    samples = Samples(EGO_ONLY, TRAINING, moments, emphasis)
    valid = samples._sample(row, TRAINING.varied, 3, 0).targets["valid"][0]
    assert not valid[~torch.from_numpy(emphasis.known[row, :4])].any()


def test_a_share_of_samples_is_told_wrong_speeds_and_none_wrong_labels(moments):
    samples = Samples(EGO_ONLY, TRAINING, moments)
    drive, number = moving(samples, moments)
    renderer = samples._renderer(drive)
    off = list[bool]()
    for key in range(60):
        given = {"variation": TRAINING.varied, "key": key, "past": 0}
        true, told = (renderer.sample(drive, number, mistold=m, **given) for m in (0.0, 0.4))
        off.append(not torch.equal(true.inputs[0]["speed"], told.inputs[0]["speed"]))
        assert torch.equal(true.targets["waypoints"], told.targets["waypoints"])
    assert np.mean(off) == pytest.approx(0.4, abs=4.0 * np.sqrt(0.24 / len(off)))
