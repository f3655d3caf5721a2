"""Training: exact when stopped and gone on with, clear when it cannot go on, able to learn."""

from __future__ import annotations

import dataclasses
import math

import pytest
import torch

from agents.driveinsight.config import TOKENS
from agents.driveinsight.losses import losses
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import (
    WeightsError,
    from_pretrained,
    save_pretrained,
    take_weights,
    weights_digest,
)
from agents.training.config import HELD_OUT, TrainConfig, TrainingError
from agents.training.data_card import drive_paths
from agents.training.frames import DriveFileError, read_drive
from agents.training.learning import Training
from agents.training.loading import Samples, batches
from agents.training.log import forget_rows_after, read_rows, write_curve
from agents.training.loop import (
    CHECKPOINT_FILE,
    CHECKS_FILE,
    LOG_FILE,
    POLICY_FOLDER,
    Checks,
    train,
)
from agents.training.moments import load_moments
from agents.training.predictions import look
from agents.training.samples import batch_of, hidden_components
from agents.training.waypoints import expert_waypoints
from tests.agents.training.small_policies import PROMPT_ONLY, SEEING, on_disk

SHORT = TrainConfig(steps=6, batch=3, warm_up=2)


@pytest.fixture(scope="module")
def moments(drives):
    return load_moments([drives], standing_share=0.3)


def trained(folder, policy, config, moments, *, stop_at=None, checks=None, workers=0):
    """A training that goes on from what the folder holds; it stops early if it is told to."""
    training = Training.begin(policy, config, "cpu")
    if (folder / CHECKPOINT_FILE).exists():
        training.load(folder / CHECKPOINT_FILE)
    samples = Samples(policy, config, moments)
    data = batches(samples, first_step=training.step, workers=workers)
    train(training, data, folder, stop=lambda: training.step == stop_at, checks=checks)
    data.close()
    return training


def assert_same_weights(one, other):
    theirs = other.policy.state_dict()
    for name, value in one.policy.state_dict().items():
        assert torch.equal(value, theirs[name]), name


@pytest.mark.parametrize("policy", [PROMPT_ONLY, SEEING], ids=lambda policy: policy.name)
def test_stopped_and_gone_on_with_is_the_same_to_the_bit(tmp_path, moments, policy):
    whole = trained(tmp_path / "whole", policy, SHORT, moments)
    first = trained(tmp_path / "halves", policy, SHORT, moments, stop_at=3)
    assert first.step == 3
    second = trained(tmp_path / "halves", policy, SHORT, moments)
    assert second.step == 6
    assert_same_weights(whole, second)


def test_processes_that_render_change_no_bit(tmp_path, moments):
    here = trained(tmp_path / "here", PROMPT_ONLY, SHORT, moments)
    there = trained(tmp_path / "there", PROMPT_ONLY, SHORT, moments, workers=1)
    assert_same_weights(here, there)


def test_rows_written_after_the_checkpoint_come_again_once(tmp_path, moments):
    config = dataclasses.replace(SHORT, steps=60, batch=1)
    trained(tmp_path, PROMPT_ONLY, config, moments, stop_at=20)
    kept = (tmp_path / CHECKPOINT_FILE).read_bytes()
    trained(tmp_path, PROMPT_ONLY, config, moments, stop_at=45)
    (tmp_path / CHECKPOINT_FILE).write_bytes(kept)  # as if killed before the next one
    trained(tmp_path, PROMPT_ONLY, config, moments)
    assert [row["step"] for row in read_rows(tmp_path / LOG_FILE)] == [20, 40, 60]


def test_the_policy_that_drove_best_is_kept_and_no_check_is_made_twice(tmp_path, moments):
    scores, asked = {2: 10.0, 4: 30.0, 6: 20.0}, []

    def score_of(training_step):
        def score(policy):
            asked.append(training_step())
            return {"driving_score": scores[asked[-1]]}

        return score

    training = Training.begin(PROMPT_ONLY, SHORT, "cpu")
    data = batches(Samples(PROMPT_ONLY, SHORT, moments))
    at_step_4 = {}

    def watch(step, terms):
        if step == 4:
            at_step_4.update({n: v.clone() for n, v in training.policy.state_dict().items()})

    checks = Checks(every=2, score=score_of(lambda: training.step))
    assert train(training, data, tmp_path, checks=checks, on_step=watch)
    assert asked == [2, 4, 6]
    kept = from_pretrained(tmp_path / POLICY_FOLDER).state_dict()
    assert all(torch.equal(kept[name], on_disk(value)) for name, value in at_step_4.items())
    train(training, data, tmp_path, checks=checks)
    assert asked == [2, 4, 6]
    assert "| 4 | 30 |" in (tmp_path / POLICY_FOLDER / "README.md").read_text()


def test_a_check_that_was_interrupted_is_made_when_it_goes_on(tmp_path, moments):
    training = Training.begin(PROMPT_ONLY, SHORT, "cpu")
    samples = Samples(PROMPT_ONLY, SHORT, moments)
    leaves = Checks(every=4, score=lambda policy: None)
    assert not train(training, batches(samples), tmp_path, checks=leaves)
    again = trained(
        tmp_path,
        PROMPT_ONLY,
        SHORT,
        moments,
        checks=Checks(every=4, score=lambda policy: {"driving_score": 50.0}),
    )
    assert again.step == 6
    assert [row["step"] for row in read_rows(tmp_path / CHECKS_FILE)] == [4, 6]


def test_a_loss_that_is_no_number_ends_it_and_leaves_a_whole_checkpoint(tmp_path, moments):
    config = dataclasses.replace(SHORT, learning_rate=1e25, warm_up=0)
    training = Training.begin(PROMPT_ONLY, config, "cpu")
    training.save(tmp_path / CHECKPOINT_FILE)
    data = batches(Samples(PROMPT_ONLY, config, moments))
    with pytest.raises(TrainingError, match=r"at step \d: try a lower --learning-rate"):
        train(training, data, tmp_path)
    fresh = Training.begin(PROMPT_ONLY, config, "cpu")
    fresh.load(tmp_path / CHECKPOINT_FILE)
    assert fresh.step == 0
    assert all(torch.isfinite(value).all() for value in fresh.policy.state_dict().values())


def test_a_checkpoint_of_other_options_is_refused_by_name(tmp_path, moments):
    trained(tmp_path, PROMPT_ONLY, SHORT, moments, stop_at=1)
    for other in ({"batch": 4}, {"seed": 1}, {"data": "another"}):
        training = Training.begin(PROMPT_ONLY, dataclasses.replace(SHORT, **other), "cpu")
        with pytest.raises(TrainingError, match=f"of another training .{next(iter(other))} was"):
            training.load(tmp_path / CHECKPOINT_FILE)
    with pytest.raises(TrainingError, match="policy 'name' was test-prompt-only, is test-seeing"):
        Training.begin(SEEING, SHORT, "cpu").load(tmp_path / CHECKPOINT_FILE)


def test_a_checkpoint_cut_off_says_what_to_do(tmp_path, moments):
    trained(tmp_path, PROMPT_ONLY, SHORT, moments, stop_at=1)
    path = tmp_path / CHECKPOINT_FILE
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(TrainingError, match=r"is not whole .*delete it to begin again"):
        Training.begin(PROMPT_ONLY, SHORT, "cpu").load(path)


def test_no_drives_and_a_cut_off_drive_say_what_to_do(tmp_path, drives):
    with pytest.raises(TrainingError, match="run `driveinsight collect` first"):
        load_moments([tmp_path], 0.3)
    (tmp_path / "small_grid").mkdir()
    whole = drive_paths(drives)[0].read_bytes()
    (tmp_path / "small_grid" / "00000.npz").write_bytes(whole[:5000])
    with pytest.raises(DriveFileError, match="delete it and run collect again"):
        load_moments([tmp_path], 0.3)


@pytest.mark.parametrize("workers", [0, 1])
def test_a_drive_that_goes_missing_meanwhile_is_named(tmp_path, drives, workers):
    (tmp_path / "small_grid").mkdir()
    path = tmp_path / "small_grid" / "00000.npz"
    path.write_bytes(drive_paths(drives)[0].read_bytes())
    moments = load_moments([tmp_path], 0.3)
    path.unlink()
    data = batches(Samples(PROMPT_ONLY, SHORT, moments), workers=workers)
    with pytest.raises((TrainingError, DriveFileError), match=r"^[^\n]*00000.npz is missing"):
        next(data)


def test_one_moment_is_learnt_by_heart_to_ten_centimetres(tmp_path, moments):
    config = TrainConfig(steps=250, batch=2, overfit=1, learning_rate=1e-2, warm_up=5)
    trained(tmp_path, PROMPT_ONLY, config, moments)
    rows = read_rows(tmp_path / LOG_FILE)
    assert rows[0]["waypoints"] > 1.0
    assert rows[-1]["waypoints"] < 0.1


def test_equal_numbers_give_equal_samples_and_others_give_others(moments):
    samples, again = (Samples(SEEING, SHORT, moments) for _ in range(2))
    again[4]  # what was rendered before makes no difference
    one, other = samples[3], again[3]
    for a, b in zip(one.inputs, other.inputs, strict=True):
        for ours, theirs in zip(a.images, b.images, strict=True):
            assert torch.equal(ours, theirs)
        assert torch.equal(a.points, b.points)
    assert not torch.equal(samples[4].inputs[-1].images[0], one.inputs[-1].images[0])


def test_a_sample_at_a_drives_start_remembers_nothing_of_before_it(moments):
    """Beside a longer one it gives what it gives alone."""
    renderer_of = Samples(SEEING, SHORT, moments)
    drive = renderer_of._drive(0)
    renderer = renderer_of._renderer(drive)
    short = renderer.sample(drive, 0, SHORT.variation, key=7, past=2)
    long = renderer.sample(drive, 40, SHORT.variation, key=8, past=2)
    assert (len(short.inputs), len(long.inputs)) == (1, 3)
    torch.manual_seed(0)
    policy = Policy(SEEING).eval()

    def last(samples):
        batch = batch_of(samples)
        hidden = torch.ones(len(samples), 10)
        with torch.no_grad():
            output, targets = look(policy, batch, hidden)
        return output.waypoints, targets.valid, batch.begun

    together, valid, begun = last([short, long])
    assert begun.tolist() == [[0.0, 1.0], [0.0, 1.0], [1.0, 1.0]]
    assert valid.sum() > 0
    assert torch.allclose(together[0], last([short])[0][0], atol=1e-5)
    assert torch.allclose(together[1], last([long])[0][0], atol=1e-5)


def test_mixed_precision_gives_whole_waypoints_near_the_exact_ones(moments):
    torch.manual_seed(0)
    policy = Policy(SEEING).eval()
    batch = batch_of([Samples(SEEING, SHORT, moments)[0]])
    hidden = torch.ones(1, 10)
    with torch.no_grad():
        exact, _ = look(policy, batch, hidden)
        mixed, targets = look(policy, batch, hidden, mixed=True)
    assert mixed.waypoints.dtype == torch.float32
    assert torch.allclose(exact.waypoints, mixed.waypoints, atol=0.2)
    terms = losses(mixed, targets, SHORT.loss)
    assert all(term.dtype == torch.float32 for term in terms.values())


def test_components_are_hidden_as_often_as_the_configuration_says():
    hidden = 1.0 - hidden_components(PROMPT_ONLY, 4000, key=3).numpy().mean(axis=0)
    config = PROMPT_ONLY.planner
    given = dict.fromkeys(TOKENS, 1.0)
    for names, rate in (*config.dropout.items(), *config.together.items()):
        for name in names.split("+"):
            given[name] *= 1.0 - rate
    rates = [1.0 - given[name] for name in TOKENS]
    assert hidden == pytest.approx(rates, abs=5.0 * math.sqrt(0.25 / 4000))


def test_a_policy_with_sensors_begins_with_the_planner_of_one_without(tmp_path):
    torch.manual_seed(1)
    teacher = Policy(dataclasses.replace(PROMPT_ONLY, planner=SEEING.planner))
    save_pretrained(teacher, tmp_path, "a card")
    policy = Policy(SEEING)
    before = {name: value.clone() for name, value in policy.state_dict().items()}
    taken, left = take_weights(policy, tmp_path)
    assert "planner.query" in taken
    assert not left
    for name, value in policy.state_dict().items():
        expected = on_disk(teacher.state_dict()[name]) if name in taken else before[name]
        assert torch.equal(value, expected), name
    assert len(weights_digest(tmp_path)) == 32


def test_weights_of_which_nothing_fits_are_refused(tmp_path):
    with pytest.raises(WeightsError, match="there is no"):
        weights_digest(tmp_path)


def test_drives_kept_out_are_learnt_from_by_nobody_and_stay_the_same_as_more_come(moments):
    taught, kept_out = moments.held_out(0.01)
    assert len(taught) + len(kept_out) == len(moments)
    assert set(kept_out.drive) == {int(moments.draws.argmin())}  # one at least
    assert not set(taught.drive) & set(kept_out.drive)
    _, half = moments.held_out(0.5)
    assert set(half.drive) == set(kept_out.drive)  # of two no more than half
    everything, nothing = moments.held_out(0.0)
    assert (len(everything), len(nothing)) == (len(moments), 0)
    with pytest.raises(TrainingError, match="collect more, or give --held-out 0"):
        taught.held_out(0.1)


def test_what_is_measured_is_the_same_each_time_and_set_aside_nowhere(moments):
    config = dataclasses.replace(SHORT, held_out=0.1)
    samples = Samples(PROMPT_ONLY, config, moments)
    _, kept_out = moments.held_out(0.1)
    assert len(samples) == 18
    assert config.measured == 66  # whole batches of 3
    place = kept_out.some(66)
    drive = read_drive(moments.paths[place.drive[5]])
    there = samples[18 + 5].targets.waypoints[0]
    pose = drive.poses()[place.moment[5]]
    expected, _ = expert_waypoints(drive, place.moment[5], 8, pose)
    assert torch.equal(there, torch.from_numpy(expected))


def test_a_log_says_how_drives_kept_out_do_where_it_was_measured(tmp_path, moments):
    config = dataclasses.replace(SHORT, steps=30, held_out=0.1)
    trained(tmp_path, PROMPT_ONLY, config, moments, stop_at=20)
    trained(tmp_path, PROMPT_ONLY, config, moments)
    first, last = read_rows(tmp_path / LOG_FILE)
    assert HELD_OUT not in first
    assert last[HELD_OUT] > 0.0
    forget_rows_after(tmp_path / LOG_FILE, 20)
    assert read_rows(tmp_path / LOG_FILE) == [first]
    assert HELD_OUT in (tmp_path / LOG_FILE).read_text()  # the column is still there
    assert write_curve(tmp_path / "curve.png", [first, last], [])


def test_a_checkpoint_older_than_an_option_is_one_of_its_default(tmp_path, moments):
    trained(tmp_path, PROMPT_ONLY, SHORT, moments, stop_at=1)
    content = torch.load(tmp_path / CHECKPOINT_FILE, weights_only=True)
    del content["asked"]["held_out"]
    torch.save(content, tmp_path / CHECKPOINT_FILE)
    Training.begin(PROMPT_ONLY, SHORT, "cpu").load(tmp_path / CHECKPOINT_FILE)
    other = dataclasses.replace(SHORT, held_out=0.1)
    with pytest.raises(TrainingError, match=r"held_out was 0\.0, is 0\.1"):
        Training.begin(PROMPT_ONLY, other, "cpu").load(tmp_path / CHECKPOINT_FILE)
