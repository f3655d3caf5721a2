"""The whole network: shapes, independence of samples, hidden components, gradients, learning."""

from __future__ import annotations

import dataclasses
import os

import pytest
import torch

from agents.driveinsight.config import (
    CONFIGS,
    TOKENS,
    CameraEncoderConfig,
    FusionConfig,
    LidarEncoderConfig,
    PlannerConfig,
    PolicyConfig,
    config_named,
)
from agents.driveinsight.losses import LossConfig, losses
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import WeightsError, from_pretrained, save_pretrained
from agents.networks.grid import GridConfig
from agents.networks.taps import editing, tap_names, watching
from di_envs.prompt import COMPONENTS
from tests.agents.driveinsight.random_inputs import awake, random_inputs, random_targets, sample

WHOLE = config_named("driveinsight")
VARIANTS = {
    "driveinsight": WHOLE,
    "without-cameras": dataclasses.replace(WHOLE, camera=None),
    "without-lidar": dataclasses.replace(WHOLE, lidar=None),
    "driveinsight-told": config_named("driveinsight-told"),
    "driveinsight-sensors": config_named("driveinsight-sensors"),
}


def new_policy(name):
    torch.manual_seed(0)
    return awake(Policy(VARIANTS[name]))


@pytest.fixture(scope="module")
def small():
    return new_policy("driveinsight").eval()


@pytest.mark.parametrize("name", VARIANTS)
def test_each_configuration_plans_eight_waypoints(name):
    policy = new_policy(name).eval()
    with torch.inference_mode():
        output = policy(random_inputs(policy.config, batch=2))
    assert output.waypoints.shape == (2, 8, 2)
    assert (output.bev is None) == (name == "driveinsight-told")


def test_a_batch_equals_its_samples_one_by_one(small):
    inputs = random_inputs(small.config, batch=3)
    with torch.inference_mode():
        together = small(inputs).waypoints
        for n in range(3):
            alone = small(sample(inputs, n)).waypoints[0]
            assert torch.allclose(together[n], alone, atol=1e-5)


@pytest.mark.parametrize("component", TOKENS)
def test_what_is_not_present_makes_no_difference_whatever_its_values(small, component):
    inputs = random_inputs(small.config)
    inputs.present[:, TOKENS.index(component)] = 0.0
    other = random_inputs(small.config, seed=7)
    if component == "bev":
        changed = dataclasses.replace(inputs, images=other.images, points=other.points)
    else:
        prompt = {**inputs.prompt, component: other.prompt[component]}
        changed = dataclasses.replace(inputs, prompt=prompt)
    with torch.inference_mode():
        assert torch.equal(small(inputs).waypoints, small(changed).waypoints)


def test_a_component_that_is_not_present_has_the_zero_token(small):
    inputs = random_inputs(small.config)
    inputs.present[:, TOKENS.index("routing")] = 0.0
    with torch.inference_mode(), watching(small, "prompt.taps.routing", "prompt.taps.map") as seen:
        small(inputs)
    assert not seen["prompt.taps.routing"][0].any()
    assert seen["prompt.taps.map"][0].any()


def test_a_policy_without_privilege_reads_no_privileged_component():
    policy = new_policy("driveinsight-sensors").eval()
    inputs = random_inputs(policy.config)
    other = random_inputs(policy.config, seed=3).prompt
    hidden = {name: other[name] for name in ("map", "obstacles", "traffic_lights", "stop_signs")}
    changed = dataclasses.replace(inputs, prompt={**inputs.prompt, **hidden})
    with torch.inference_mode():
        assert torch.equal(policy(inputs).waypoints, policy(changed).waypoints)


def test_memory_comes_in_and_goes_out_as_a_value(small):
    first, second = random_inputs(small.config, seed=1), random_inputs(small.config, seed=2)
    empty = small.perception.empty_bank(1, like=torch.zeros(1))
    with torch.inference_mode():
        bank = empty.remember(small(first).remembered, first.pose)
        remembered = small(second, bank).waypoints
        again = small(second, bank).waypoints
        forgetful = small(second, empty).waypoints
    assert torch.equal(remembered, again)
    assert not torch.equal(remembered, forgetful)


@pytest.mark.parametrize("name", VARIANTS)
def test_gradients_reach_every_parameter(name):
    policy = new_policy(name).train()
    inputs = random_inputs(policy.config, batch=2)
    output = policy(inputs)
    bank = None
    if policy.config.memory_frames:
        remembered = output.remembered
        bank = policy.perception.empty_bank(2, like=remembered).remember(remembered, inputs.pose)
        output = policy(inputs, bank)
    losses(output, random_targets(output), LossConfig())["total"].backward()
    without = [name for name, value in policy.named_parameters() if value.grad is None]
    assert without == []
    # what is never given moves no encoder that is its alone
    never = tuple(f"prompt.{name}." for name in COMPONENTS if name not in policy.config.prompt)
    if "traffic_lights" not in policy.config.prompt:  # eyes that learnt nothing come to no signal
        never += ("prompt.signals.encode.next.",)
    still = [n for n, v in policy.named_parameters() if not v.grad.abs().sum() > 0.0]
    assert [n for n in still if not n.startswith(never)] == []


TINY = PolicyConfig(
    name="tiny",
    grid=GridConfig(cells=16),
    camera=CameraEncoderConfig(rig="rl", width=8, channels=16, depth_bins=24),
    lidar=LidarEncoderConfig(channels=16),
    planner=PlannerConfig(width=48, heads=4, layers=2),
    fusion=FusionConfig(width=16, remembered=8, widths=(16, 16)),
)


@pytest.mark.slow
def test_one_batch_can_be_learnt_by_heart_to_5_cm():
    torch.manual_seed(0)
    policy = Policy(TINY).train()
    inputs = random_inputs(TINY, batch=4, rays=200)
    with torch.no_grad():
        targets = random_targets(policy(inputs))
    optimiser = torch.optim.AdamW(policy.parameters(), lr=4e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, 400)
    for _ in range(400):
        optimiser.zero_grad()
        terms = losses(policy(inputs), targets, LossConfig())
        terms["total"].backward()
        optimiser.step()
        schedule.step()
        if terms["waypoints"] < 0.05:
            break
    assert terms["waypoints"] < 0.05


def test_missing_waypoints_of_a_drive_that_ended_cost_nothing(small):
    with torch.inference_mode():
        output = small(random_inputs(small.config))
    targets = random_targets(output)
    targets.valid[:, 4:] = 0.0
    wrong = dataclasses.replace(targets, waypoints=targets.waypoints.clone())
    wrong.waypoints[:, 4:] += 100.0
    first, second = (losses(output, t, LossConfig())["waypoints"] for t in (targets, wrong))
    assert torch.equal(first, second)


def test_near_waypoints_weigh_more_than_far_ones(small):
    with torch.inference_mode():
        output = small(random_inputs(small.config))
    targets = random_targets(output)
    aligned = dataclasses.replace(targets, waypoints=output.waypoints.clone())
    loss = {}
    for k in (0, 7):
        wrong = dataclasses.replace(aligned, waypoints=aligned.waypoints.clone())
        wrong.waypoints[:, k, 0] += 1.0
        for nearness in (0.0, 1.0):
            terms = losses(output, wrong, LossConfig(nearness=nearness))
            loss[k, nearness] = float(terms["waypoints"])
    assert loss[0, 0.0] == pytest.approx(loss[7, 0.0]) == pytest.approx(1.0 / 8.0)
    whole = sum(1.0 / k for k in range(1, 9))
    assert loss[0, 1.0] == pytest.approx(1.0 / whole)
    assert loss[7, 1.0] == pytest.approx(1.0 / 8.0 / whole)


def test_taps_are_named_by_their_place_and_can_be_edited(small):
    names = tap_names(small)
    eyes = ("camera.views.1.depth", "lidar.bev", "fusion.bev", "memory.bev", "heads.lamps.tap")
    assert {*(f"perception.{name}" for name in eyes), "waypoints"} <= set(names)
    assert "planner.layers.0.attention.weights" in names
    inputs = random_inputs(small.config)
    with torch.inference_mode(), watching(small, "planner.layers.0.attention.weights") as seen:
        plain = small(inputs).waypoints
        with editing(small, {"bev.tokens": torch.zeros_like}):
            edited = small(inputs).waypoints
        after = small(inputs).waypoints
    inputs.present[:, TOKENS.index("bev")] = 0.0
    with torch.inference_mode():
        assert torch.equal(edited, small(inputs).waypoints)
    assert not torch.equal(plain, edited)
    assert torch.equal(plain, after)
    weights = seen["planner.layers.0.attention.weights"][0]
    # nine components, and one more for what comes next in three; five of what is seen
    assert weights.shape == (1, 6, 1, 9 + 3 + 5)
    assert torch.allclose(weights.sum(dim=-1), torch.ones(1, 6, 1))


def test_an_unknown_tap_is_refused_with_a_suggestion(small):
    unknown = r"Unknown tap 'perception.fusion.bew'; did you mean 'perception.fusion.bev'"
    with pytest.raises(ValueError, match=unknown), watching(small, "perception.fusion.bew"):
        pass


def test_a_policy_survives_the_way_to_disk_and_back(tmp_path, small):
    save_pretrained(small, tmp_path, card="# A card\n")
    loaded = from_pretrained(tmp_path)
    assert loaded.config == small.config
    for name, value in loaded.state_dict().items():
        ours = small.state_dict()[name]
        assert value.dtype == ours.dtype, name
        assert torch.equal(value, ours.half().to(ours.dtype)), name  # float16 on disk
    save_pretrained(loaded, tmp_path / "again", card="# A card\n")
    first, again = (tmp_path / part / "weights.safetensors" for part in ("", "again"))
    assert first.read_bytes() == again.read_bytes()


def test_weights_that_float16_does_not_hold_are_not_written(tmp_path):
    policy = Policy(config_named("route-only"))
    with torch.no_grad():
        policy.planner.query[0, 0, 0] = 1e5
    with pytest.raises(WeightsError, match=r"'planner.query' holds numbers that float16 cannot"):
        save_pretrained(policy, tmp_path, card="")


def _full(_: int) -> None:
    raise OSError("the disk is full")


def test_weights_that_cannot_be_written_leave_the_old_ones(tmp_path, small, monkeypatch):
    save_pretrained(small, tmp_path, card="old")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.setattr(os, "fsync", _full)
    with pytest.raises(OSError, match="the disk is full"):
        save_pretrained(new_policy("driveinsight-told"), tmp_path, card="new")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_broken_or_foreign_weights_are_refused(tmp_path, small):
    with pytest.raises(WeightsError, match=r"config\.json: cannot be read"):
        from_pretrained(tmp_path)
    save_pretrained(small, tmp_path, card="")
    weights = tmp_path / "weights.safetensors"
    whole = weights.read_bytes()
    weights.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(WeightsError, match="is not whole"):
        from_pretrained(tmp_path)
    save_pretrained(new_policy("driveinsight-told"), tmp_path / "other", card="")
    weights.write_bytes((tmp_path / "other" / "weights.safetensors").read_bytes())
    with pytest.raises(WeightsError, match=r"does not fit .*'driveinsight'"):
        from_pretrained(tmp_path)
    config = tmp_path / "config.json"
    config.write_text(config.read_text().replace('"format_version": 2', '"format_version": 0'))
    with pytest.raises(WeightsError, match="is of format 0"):
        from_pretrained(tmp_path)


@pytest.mark.parametrize("name", CONFIGS)
def test_a_configuration_survives_the_way_through_json(name):
    config = config_named(name)
    assert PolicyConfig.from_mapping(config.to_mapping()) == config


@pytest.mark.parametrize(
    ("find", "put", "says"),
    [
        ('"cells": 96', '"cells": "96"', r"config\.json: grid\.cells: expected a whole number"),
        ('"cells": 96', '"cells": 47', r"config\.json: grid: .* multiple of 8 cells"),
        ('"cells": 96', '"cell": 96', r"config\.json: grid: unknown field 'cell'"),
        ('"cells": 96', '"cells": NaN', r"config\.json: is not whole JSON: NaN"),
        ('"name": "driveinsight",', "", r"config\.json: name: is missing"),
        ('{\n "format_version"', "[" * 100_000 + '{\n "format_version"', "nested deeper than 64"),
        ('{\n "format_version"', '["format_version"]\n#', "is not whole JSON"),
    ],
    ids=["type", "value", "name", "NaN", "missing", "deep", "list"],
)
def test_a_wrong_configuration_file_says_where_it_is_wrong(tmp_path, small, find, put, says):
    save_pretrained(small, tmp_path, card="")
    path = tmp_path / "config.json"
    assert find in path.read_text()
    path.write_text(path.read_text().replace(find, put))
    with pytest.raises(WeightsError, match=says) as caught:
        from_pretrained(tmp_path)
    assert "\n" not in str(caught.value)


def test_wrong_configurations_are_refused_with_the_next_step():
    with pytest.raises(
        ValueError,
        match=r"Unknown policy configuration 'driveinsigth'; did you mean 'drivein",
    ):
        config_named("driveinsigth")
    with pytest.raises(ValueError, match=r"field 'memory_frame'; did you mean 'memory_frames'"):
        PolicyConfig.from_mapping({"name": "mine", "memory_frame": 2})
    with pytest.raises(ValueError, match="needs a camera, a LiDAR or a prompt component"):
        PolicyConfig(name="blind", camera=None, lidar=None, prompt=())
