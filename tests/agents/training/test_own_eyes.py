"""What a policy's own eyes saw of drives: as if it drove there; what its planner learns from."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from agents.driveinsight.model import Inputs, Policy
from agents.driveinsight.reading import read_seen
from agents.driveinsight.weights import from_pretrained, save_pretrained
from agents.training.caching import cached
from agents.training.config import PLANNING, TrainConfig, TrainingError
from agents.training.data_card import drive_paths
from agents.training.frames import read_drive, write_drive
from agents.training.loading import town_of
from agents.training.moments import load_moments
from agents.training.own_eyes import (
    CHUNK,
    SEEN,
    digest_of_rows,
    look_at,
    look_job,
    look_jobs,
    own_eyes,
    shown_of,
)
from agents.training.planning import PlanningSamples
from agents.training.seen_noise import NO_NOISE
from agents.training.sequences import SequenceRenderer
from agents.training.variation import NO_VARIATION
from tests.agents.training.small_policies import PROMPT_ONLY, SEEING

SHORT = TrainConfig(
    **{**PLANNING, "measured_moments": 8},
    steps=3,
    batch=4,
    warm_up=1,
    eyes=NO_NOISE,
    variation=NO_VARIATION,
)
MOMENTS = CHUNK + 3


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    """A folder of a policy that has not learnt anything."""
    folder = tmp_path_factory.mktemp("policy")
    torch.manual_seed(0)
    save_pretrained(Policy(SEEING), folder, "untrained")
    return folder


@pytest.fixture(scope="module")
def short_drive(drives):
    return read_drive(drive_paths(drives)[0]).cut(MOMENTS)


@pytest.fixture(scope="module")
def seen(drives, policy, short_drive, tmp_path_factory):
    """A folder with what it sees of the first moments of the first drive."""
    folder = tmp_path_factory.mktemp("short")
    path = folder / "small_grid" / drive_paths(drives)[0].name
    write_drive(path, short_drive)
    (job,) = look_jobs([path], policy, folder / "seen")
    assert look_job(job) == MOMENTS
    return folder / "seen"


def test_it_sees_what_it_would_see_if_it_came_that_way(policy, seen, short_drive):
    """Its rows are those of the policy asked moment by moment, with its memory."""
    (path,) = seen.glob("*.npy")
    rows = np.load(path)
    assert rows.dtype == SEEN
    asked = from_pretrained(policy)
    renderer = SequenceRenderer(SEEING, *town_of(short_drive), depth=False)
    shown = shown_of(renderer, short_drive, MOMENTS - 1, MOMENTS)
    bank = None
    with torch.no_grad():
        for moment in range(MOMENTS):
            assert asked.perception is not None
            encoded = asked.perception.encode(
                tuple(group[moment : moment + 1] for group in shown.images),
                shown.points[moment : moment + 1],
            )
            pose = shown.poses[moment : moment + 1]
            bev = asked.perception.fuse(encoded, pose, bank)
            found = read_seen(asked.perception.say(bev, encoded), SEEING.grid)
            np.testing.assert_allclose(
                rows["objects"][moment], found.objects[0].numpy(), atol=0.06, rtol=2e-3
            )
            np.testing.assert_allclose(
                rows["signals"][moment], found.signals[0].numpy(), atol=0.06, rtol=2e-3
            )
            bank = bank or asked.perception.empty_bank(1, like=encoded.remembered)
            bank = bank.remember(encoded.remembered, pose)


def test_a_planner_is_shown_what_its_own_eyes_saw_and_is_lent_eyes_elsewhere(drives, tmp_path):
    moments = load_moments([drives], 0.3)
    cache = cached(moments, SEEING.grid, tmp_path)
    marked = np.zeros(MOMENTS, SEEN)
    marked["objects"][:, 0] = [5.0, 1.0, 0.0, 4.0, 2.0, 0.0, 0.0, 1.0, 0.75]
    drive = drive_paths(drives)[0]
    chosen = (moments.drive == 0) & (moments.moment < MOMENTS)
    kept = dataclasses.replace(
        cache, moments=moments._rows(np.flatnonzero(chosen | (moments.drive == 1)))
    )
    kept = dataclasses.replace(kept, rows=cache.rows[chosen | (moments.drive == 1)])
    folder = tmp_path / "seen"
    folder.mkdir()
    np.save(folder / f"small_grid-{drive.stem}.npy", marked)
    own = own_eyes(kept.moments, [folder])
    assert own.looked.tolist() == (kept.moments.drive == 0).tolist()
    samples = PlanningSamples.of(SEEING, SHORT, kept, own)
    lent = PlanningSamples.of(SEEING, SHORT, kept)
    for step in range(3):
        drawn, other = (each.batch(step, slice(0, 4)).inputs[0] for each in (samples, lent))
        assert isinstance(drawn, Inputs)
        for row in range(4):
            saw = drawn.seen.objects[row]
            if saw[0, 8] == 0.75:
                assert saw[0].tolist() == pytest.approx(marked["objects"][0, 0].tolist())
            else:
                assert torch.equal(saw, other.seen.objects[row])


def test_looking_goes_on_where_it_was_left_and_is_told_by_its_digest(
    policy, seen, drives, tmp_path
):
    (path,) = seen.glob("*.npy")
    before = digest_of_rows([seen])
    drive = seen.parent / "small_grid" / drive_paths(drives)[0].name
    assert list(look_at(look_jobs([drive], policy, seen), 1)) == [MOMENTS]  # nothing is done again
    assert digest_of_rows([seen]) == before != ""
    assert digest_of_rows([]) == ""
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(TrainingError, match=r"is not whole .*: delete it to look again"):
        look_job(look_jobs([drive], policy, seen)[0])


def test_rows_of_other_drives_and_eyes_that_are_none_are_refused(drives, tmp_path):
    moments = load_moments([drives], 0.3)
    drive = drive_paths(drives)[0]
    with pytest.raises(TrainingError, match="two drives have the same town and number"):
        look_jobs([drive, drive], tmp_path, tmp_path)
    with pytest.raises(TrainingError, match="shows nothing of these drives"):
        own_eyes(moments, [tmp_path])
    np.save(tmp_path / f"small_grid-{drive.stem}.npy", np.zeros(2, SEEN))
    with pytest.raises(
        TrainingError, match=r"shows 2 moments, the drive .* it is of another drive"
    ):
        own_eyes(moments, [tmp_path])
    torch.manual_seed(0)
    save_pretrained(Policy(PROMPT_ONLY), tmp_path / "blind", "untrained")
    with pytest.raises(TrainingError, match="has no sensors: it sees nothing"):
        look_job(look_jobs([drive], tmp_path / "blind", tmp_path / "seen")[0])
