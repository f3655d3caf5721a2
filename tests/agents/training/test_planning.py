"""A planner that learns from encoded moments: what they hold, and how they vary."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from agents.driveinsight.config import config_named
from agents.training.caching import MOMENT, MomentReader, cached
from agents.training.config import PLANNING, TrainConfig, TrainingError
from agents.training.frames import DriveStage, read_drive
from agents.training.learning import Training
from agents.training.loading import town_of
from agents.training.log import read_rows
from agents.training.loop import CHECKPOINT_FILE, LOG_FILE, train
from agents.training.moments import load_moments
from agents.training.planning import PlanningSamples, set_aside
from agents.training.told_speeds import told_speeds
from agents.training.variation import Variation
from agents.training.waypoints import expert_waypoints
from di_envs.observer import Observer
from tests.agents.training.small_policies import SEEING

POLICY = dataclasses.replace(SEEING, grid=config_named("driveinsight").grid, lidar=None)
SHORT = TrainConfig(
    **{**PLANNING, "measured_moments": 8, "measured_every": 20},
    steps=30,
    batch=4,
    warm_up=2,
    held_out=0.1,
)
BOTH = slice(0, 4)


@pytest.fixture(scope="module")
def cache(drives, tmp_path_factory):
    moments = load_moments([drives], standing_share=0.3)
    return cached(moments, POLICY.grid, tmp_path_factory.mktemp("cache"))


def samples_of(cache, **fields):
    return PlanningSamples.of(POLICY, dataclasses.replace(SHORT, **fields), cache)


def test_a_moment_takes_five_kilobytes(cache):
    assert MOMENT.itemsize < 5000
    assert len(cache.rows) == len(cache.moments)


def test_what_is_encoded_and_set_aside_is_what_would_be_observed_there(cache, monkeypatch):
    row, right_m, turn_rad = len(cache.rows) // 3, 0.7, -0.1
    drive = read_drive(cache.moments.paths[cache.moments.drive[row]])
    town, plan_of = town_of(drive)
    stage = DriveStage(town, plan_of(drive.facts["route_id"]), drive.capacity)
    observer = Observer(town, ("prompt",))
    observer.start(stage.view)
    moment = int(cache.moments.moment[row])
    stage.set(drive, moment, right_m=right_m, turn_rad=turn_rad)
    there, state = observer.observe(), stage.view.state
    samples = samples_of(cache, held_out=0.0, mistold=0.0, turned_red=0.0, among_others=0.0)
    monkeypatch.setattr(
        "agents.training.planning.set_aside",
        lambda *_: (np.full(4, right_m), np.full(4, turn_rad)),
    )
    one = dataclasses.replace(samples, taught=np.array([row]), drawn=np.ones(1))
    batch = one.batch(0, BOTH)
    prompt = batch.inputs[0].prompt
    for name in ("target_point", "routing", "speed", "speed_history"):
        assert np.allclose(prompt[name][0], there[name], atol=0.05), name
    assert int(prompt["command"][0, 0]) == int(np.ravel(there["command"])[0])
    near = np.hypot(*there["obstacles"][:, :2].T) < 60.0  # the furthest may be others
    seen = there["obstacles"][near & (there["obstacles"][:, 8] > 0.0)]
    found = prompt["obstacles"][0].numpy()
    gaps = np.abs(found[None, :, :2] - seen[:, None, :2]).sum(axis=2)
    assert (gaps.min(axis=1) < 0.15).all()
    matched = found[gaps.argmin(axis=1)]
    assert np.allclose(np.cos(matched[:, 2] - seen[:, 2]), 1.0, atol=0.01)
    assert np.allclose(matched[:, 3:], seen[:, 3:], atol=0.05)
    pose = np.array([state.x[0], state.y[0], state.yaw[0]])
    waypoints, valid = expert_waypoints(drive, moment, 8, pose)
    assert np.allclose(batch.targets.waypoints[0], waypoints, atol=1e-3)
    assert np.array_equal(batch.targets.valid[0], valid)


def test_a_cache_is_read_again_and_one_cut_off_says_what_to_do(cache, drives, tmp_path):
    moments = load_moments([drives], standing_share=0.3)
    first = cached(moments, POLICY.grid, tmp_path)
    assert np.array_equal(first.rows.tobytes(), cache.rows.tobytes())
    path = next(tmp_path.iterdir())
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(TrainingError, match=r"is not whole .*delete it to encode again"):
        cached(moments, POLICY.grid, tmp_path)


def test_a_drive_is_encoded_once_whatever_comes_beside_it(drives, tmp_path, monkeypatch):
    moments = load_moments([drives], standing_share=0.3)
    first = moments._rows(np.flatnonzero(moments.drive == moments.drive[0]))
    cached(first, POLICY.grid, tmp_path)
    read, drives_read = MomentReader.read, set()

    def noted(self, drive, moment, out):
        drives_read.add(drive.facts["number"])
        read(self, drive, moment, out)

    monkeypatch.setattr(MomentReader, "read", noted)
    cached(moments, POLICY.grid, tmp_path)
    other = read_drive(moments.paths[moments.drive[-1]]).facts["number"]
    assert drives_read == {other}
    some = cached(moments._rows(np.arange(5, 30)), POLICY.grid, tmp_path)
    assert drives_read == {other}
    assert some.rows.tobytes() == cached(moments, POLICY.grid, tmp_path).rows[5:30].tobytes()


def test_too_many_moments_are_thinned_to_a_part_of_what_fewer_drives_gave(drives):
    moments = load_moments([drives], standing_share=0.3)
    assert len(moments.thinned(len(moments))) == len(moments)
    few, fewer = moments.thinned(60), moments.thinned(20)
    names, *pairs = (
        set(zip(m.drive.tolist(), m.moment.tolist(), strict=True)) for m in (moments, few, fewer)
    )
    assert (len(few), len(fewer)) == (60, 20)
    assert pairs[1] < pairs[0] < names
    assert (np.diff(few.drive * 10_000 + few.moment) > 0).all()  # in the order of the drives


def test_equal_steps_give_equal_batches_whatever_came_before(cache):
    samples, again = samples_of(cache), samples_of(cache)
    again.batch(7, BOTH)
    one, same, other = samples.batch(3, BOTH), again.batch(3, BOTH), samples.batch(4, BOTH)
    assert torch.equal(one.inputs[0].seen.objects, same.inputs[0].seen.objects)
    assert torch.equal(one.targets.waypoints, same.targets.waypoints)
    assert not torch.equal(one.targets.waypoints, other.targets.waypoints)


def test_a_share_of_a_batch_is_its_rows(cache):
    samples = samples_of(cache)
    whole, half = samples.batch(3, BOTH), samples.batch(3, slice(2, 4))
    assert torch.equal(whole.inputs[0].seen.objects[2:], half.inputs[0].seen.objects)
    assert torch.equal(whole.targets.waypoints[2:], half.targets.waypoints)


def run(cache, folder, stop_at=None):
    training = Training.begin(POLICY, SHORT, "cpu")
    if (folder / CHECKPOINT_FILE).exists():
        training.load(folder / CHECKPOINT_FILE)
    data = samples_of(cache).batches(training.step)
    train(training, data, folder, stop=lambda: training.step == stop_at)
    return training


def test_stopped_and_gone_on_with_is_the_same_to_the_bit(cache, tmp_path):
    whole = run(cache, tmp_path / "whole")
    run(cache, tmp_path / "halves", stop_at=20)
    halves = run(cache, tmp_path / "halves")
    for name, value in whole.policy.state_dict().items():
        assert torch.equal(value, halves.policy.state_dict()[name]), name
    assert read_rows(tmp_path / "whole" / LOG_FILE) == read_rows(tmp_path / "halves" / LOG_FILE)


def test_the_log_says_how_it_does_without_what_matters_and_what_sees_is_left_alone(cache, tmp_path):
    training = run(cache, tmp_path)
    fresh = Training.begin(POLICY, SHORT, "cpu").policy.state_dict()
    for name, value in training.policy.state_dict().items():
        if name.startswith("perception."):
            assert torch.equal(value, fresh[name]), name
    row = read_rows(tmp_path / LOG_FILE)[-1]
    columns = {name for name in row if name.startswith("held_out")}
    assert columns == {"held_out"} | {f"held_out without {names}" for names in SHORT.without}
    assert all(row[name] > 0.0 for name in columns)


def test_nobody_is_set_aside_further_than_asked_and_a_share_of_them_not_at_all():
    right_m, turn_rad = set_aside(Variation(aside_m=1.0, turn_rad=0.2, share=0.5), 2000, key=3)
    assert np.abs(right_m).max() <= 1.0
    assert np.abs(turn_rad).max() <= 0.2
    assert (right_m == 0.0).mean() == pytest.approx(0.5, abs=0.05)


def test_a_share_of_samples_is_told_wrong_speeds_each_off_by_itself_and_none_below_zero():
    moments = np.zeros(2000, MOMENT)
    moments["speed"], moments["speed_history"] = 10.0, 10.0
    told = told_speeds(moments, 0.4, key=3)
    now, past = told["speed"][:, 0] - 10.0, told["speed_history"][:, 0] - 10.0
    off = now != 0.0
    assert off.mean() == pytest.approx(0.4, abs=0.04)
    assert np.array_equal(off, past != 0.0)
    assert now[off].std() == pytest.approx(1.0, abs=0.1)
    assert abs(np.corrcoef(now[off], past[off])[0, 1]) < 0.1
    assert told_speeds(np.zeros(2000, MOMENT), 1.0, key=3)["speed"].min() == 0.0
    assert np.array_equal(told_speeds(moments, 0.0, key=3)["speed"], moments["speed"])
