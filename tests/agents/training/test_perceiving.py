"""Eyes learn from sequences: what these show, and that a run cut off comes to the same bits."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from agents.driveinsight.heads import CLASS_OF_KIND
from agents.driveinsight.model import Policy
from agents.driveinsight.perception_losses import PerceptionWeights
from agents.driveinsight.weights import from_pretrained
from agents.training.config import TrainingError
from agents.training.frames import read_drive
from agents.training.loading import town_of
from agents.training.log import read_rows
from agents.training.loop import CHECKPOINT_FILE, LOG_FILE, POLICY_FOLDER
from agents.training.moments import load_moments
from agents.training.perceive_config import PerceiveConfig
from agents.training.perceiving import (
    look,
    perceive,
)
from agents.training.perception_metrics import FIGURES
from agents.training.sequences import SequenceRenderer, joined
from agents.training.variation import NO_VARIATION, Variation
from tests.agents.training.small_policies import PROMPT_ONLY, SEEING

SHORT = PerceiveConfig(
    steps=4, batch=2, length=3, warm_up=1, held_out=0.5, measured=2, measured_every=2
)


def new_policy(config=SEEING):
    torch.manual_seed(0)
    return Policy(config)


@pytest.fixture(scope="module")
def drive(drives):
    return read_drive(load_moments([drives], 1.0).paths[0])


@pytest.fixture(scope="module")
def renderer(drive):
    return SequenceRenderer(SEEING, *town_of(drive), depth=True)


def trained(policy, drives, folder, config=SHORT, **options):
    return perceive(policy, config, [drives], folder, workers=0, **options)


def test_a_sequence_shows_its_moments_one_after_the_other(drive, renderer):
    whole = renderer.sequence(drive, 8, 3, NO_VARIATION, 5)
    assert [tuple(group.shape) for group in whole.images] == [(3, 1, 3, 84, 84)]
    assert whole.points.shape[0] == 3
    # poses are told from where the first one was
    moved = drive.poses()[6:9, :2] - drive.poses()[6, :2]
    assert np.allclose(whole.poses[:, :2], moved, atol=1e-3)
    alone = renderer.sequence(drive, 8, 1, NO_VARIATION, 5)
    assert torch.equal(whole.images[0][2], alone.images[0][0])
    assert torch.equal(whole.points[2], alone.points[0])
    assert torch.equal(whole.targets.semantics[2], alone.targets.semantics[0])


def test_at_a_drives_start_the_first_moments_are_taken(drive, renderer):
    first = renderer.sequence(drive, 0, 3, NO_VARIATION, 5)
    assert torch.equal(first.poses, renderer.sequence(drive, 2, 3, NO_VARIATION, 5).poses)


def test_equal_keys_show_equal_sequences_and_others_vary(drive, renderer):
    aside = Variation(share=1.0)
    one, same = (renderer.sequence(drive, 8, 2, aside, 5) for _ in range(2))
    other = renderer.sequence(drive, 8, 2, aside, 6)
    assert torch.equal(one.images[0], same.images[0])
    assert torch.equal(one.targets.objects, same.targets.objects)
    assert not torch.equal(one.images[0], other.images[0])
    assert not torch.equal(one.poses, other.poses)


def test_what_is_said_of_a_sequence_is_what_is_said_moment_by_moment(drive, renderer):
    perception = new_policy().eval().perception
    moments = renderer.sequence(drive, 9, 3, NO_VARIATION, 1)
    with torch.inference_mode():
        heads, _ = look(perception, joined([moments, moments]), 3)
        bank = None
        for t in range(3):
            images = tuple(group[t : t + 1] for group in moments.images)
            encoded = perception.encode(images, moments.points[t : t + 1])
            bev = perception.fuse(encoded, moments.poses[t : t + 1], bank)
            alone = perception.say(bev, encoded)
            for name in ("semantics", "heat", "boxes", "where", "state"):
                ours, theirs = getattr(heads, name)[3 + t], getattr(alone, name)[0]
                assert torch.allclose(ours, theirs, atol=1e-4), (name, t)
            bank = bank or perception.empty_bank(1, like=bev)
            bank = bank.remember(encoded.remembered, moments.poses[t : t + 1])


def test_a_run_that_was_cut_goes_on_to_the_same_bits(drives, tmp_path):
    whole, cut = new_policy(), new_policy()
    assert trained(whole, drives, tmp_path / "whole")
    seen = []
    stops = iter([False, False, True])
    left = trained(
        cut, drives, tmp_path / "cut", tell=lambda n, _: seen.append(n), stop=lambda: next(stops)
    )
    assert not left
    assert seen == [1, 2]
    other = new_policy()
    assert trained(other, drives, tmp_path / "cut", tell=lambda n, _: seen.append(n))
    assert seen == [1, 2, 3, 4]
    for name, value in whole.state_dict().items():
        assert torch.equal(value, other.state_dict()[name]), name
    rows = [read_rows(tmp_path / part / LOG_FILE) for part in ("whole", "cut")]
    assert rows[0] == rows[1]
    assert [row["step"] for row in rows[0]] == [2, 4]
    assert set(rows[0][0]) & set(FIGURES)
    kept = from_pretrained(tmp_path / "whole" / POLICY_FOLDER)
    assert kept.config == SEEING


def test_eyes_learn_and_what_plans_stays_as_it_was(drives, tmp_path):
    policy, before = new_policy(), new_policy().state_dict()
    trained(policy, drives, tmp_path)
    for name, value in policy.named_parameters():
        changed = not torch.equal(value, before[name])
        assert changed == name.startswith("perception."), name


def test_another_training_in_its_folder_is_refused_with_what_differs(drives, tmp_path):
    trained(new_policy(), drives, tmp_path)
    other = dataclasses.replace(SHORT, weights=PerceptionWeights(heat=2.0))
    with pytest.raises(TrainingError, match=r"weights 'heat' was 1.0, is 2.0"):
        trained(new_policy(), drives, tmp_path, config=other)
    (tmp_path / CHECKPOINT_FILE).write_bytes(b"half")
    with pytest.raises(TrainingError, match="is not whole"):
        trained(new_policy(), drives, tmp_path)


def test_who_has_no_eyes_is_told_so(drives, tmp_path):
    with pytest.raises(TrainingError, match="'test-prompt-only' has no sensors"):
        trained(new_policy(PROMPT_ONLY), drives, tmp_path)


def test_every_living_kind_has_a_class():
    assert {kind.name for kind in CLASS_OF_KIND} == {
        *("CAR", "VAN", "TRUCK", "BUS", "MOTORCYCLE", "BICYCLE", "WALKER")
    }
