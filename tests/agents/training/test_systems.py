"""Every system of the zoo learns one batch by heart, is stored, drives and is explained."""

from __future__ import annotations

import dataclasses

import pytest
import torch

from agents import AGENTS, AgentSpecError, load_agent
from agents.driveinsight.weights import from_pretrained, weights_digest
from agents.explain.look import look_at
from agents.networks.weights import WeightsError
from agents.training.config import TrainConfig
from agents.training.data_card import drive_paths
from agents.training.distributed import ALONE
from agents.training.frames import read_drive
from agents.training.learning import Training
from agents.training.loading import Samples, batches, town_of
from agents.training.moments import load_moments
from agents.training.samples import batch_of
from agents.training.session import TrainingPlan, begin
from agents.training.trainees import config_named, trainee_from, trainee_of
from agents.training.variation import NO_VARIATION
from agents.zoo.eyes import BevEyes
from agents.zoo.inputs import inputs_of
from agents.zoo.registry import network_of, system_names, system_of
from agents.zoo.weights import load_system, save_system
from tests.agents.training.small_policies import on_disk

NAMES = system_names()
MOST_PARAMETERS = 1_000_000  # two megabytes in float16
BY_HEART = TrainConfig(
    steps=30, batch=1, overfit=1, warm_up=5, learning_rate=3e-3, weight_decay=0.0
)
PAST = 1  # moments before it: more are more of the same
STEPS = {"mile": 120}  # of those that draw what they believe
# What falls far, but for the waypoints of the expert; a student has the points of its teacher
LEARNT = {
    "roach-raster": ("waypoints", "action"),
    "interfuser": ("waypoints", "map", "boxes", "line", "light"),
    "lbc-teacher": ("waypoints", "action"),
    "lbc": ("points",),
    "vad": ("waypoints", "ways", "kinds"),
    "mile": ("waypoints", "action"),
    "st-p3": ("waypoints", "margin"),
    "thinktwice": ("waypoints", "earlier", "action", "speed"),
    "driveadapter": ("waypoints", "action", "features"),
}
TURNING = (1, 229)  # drive and moment: it turns at a light, with others around and one ahead
# Of what hardly changes in bfloat16: which of many paths is the cheapest hangs on the last bits
ROUNDED = {"st-p3": ("vehicles", "walkers", "lines", "road", "margin")}


@pytest.fixture(scope="module")
def moments(drives):
    """One moment, of which every system has something to say."""
    every = load_moments([drives], standing_share=0.3)
    row = (every.drive == TURNING[0]) & (every.moment == TURNING[1])
    assert row.sum() == 1
    return dataclasses.replace(every, drive=every.drive[row], moment=every.moment[row])


@pytest.fixture(scope="module")
def observation(drives):
    """What there is to see of a moment, by every sensor that a system may have."""
    drive = read_drive(drive_paths(drives)[0])
    seen = {}
    for name in NAMES:
        trainee = trainee_of(config_named(name))
        renderer = trainee.renderer(*town_of(drive))
        stage, observer = renderer._stages(str(drive.facts["route_id"]), drive.capacity)
        stage.set(drive, 8)
        seen |= observer.observe() | {"world": stage.view}
    return seen


@pytest.fixture
def untrained(tmp_path, request):
    """A folder with fresh weights of a system."""
    torch.manual_seed(0)
    network = network_of(config_named(request.param))
    save_system(network, tmp_path / "policy", "a card")
    return network, tmp_path / "policy"


@pytest.mark.parametrize("name", NAMES)
def test_one_batch_is_learnt_by_heart(name, moments):
    config = config_named(name)
    config = dataclasses.replace(config, past=min(config.past, PAST))
    by_heart = dataclasses.replace(BY_HEART, steps=STEPS.get(name, BY_HEART.steps))
    training = Training.begin(config, by_heart, "cpu")
    batch = next(batches(Samples(config, by_heart, moments)))
    first = training.update(batch)
    learning = [p for p in training.policy.parameters() if p.requires_grad]
    assert all(parameter.grad is not None for parameter in learning)
    while training.step < by_heart.steps:
        last = training.update(batch)
    for term in LEARNT.get(name, ("waypoints",)):
        assert last[term] < 0.5 * first[term], (term, first, last)
    assert last["total"] < 0.25 * first["total"], (first, last)
    mixed = dataclasses.replace(by_heart, precision="bfloat16")
    rounded = Training.begin(config, mixed, "cpu").update(batch)
    for term in ROUNDED.get(name, ("total",)):
        assert rounded[term] == pytest.approx(first[term], rel=0.05), (term, first, rounded)


@pytest.mark.parametrize("name", [name for name in NAMES if system_of(name).eyes])
def test_cameras_are_those_of_the_policy_that_a_system_names(name):
    trainee = trainee_of(config_named(name))
    theirs = from_pretrained(trainee.pretrained).perception.camera.views.state_dict()
    torch.manual_seed(0)
    begun = trainee.network()
    torch.manual_seed(0)
    fresh = network_of(trainee.config).state_dict()
    eyes = next(part for part in begun.modules() if isinstance(part, BevEyes))
    path = next(name for name, part in begun.named_modules() if part is eyes)
    for tensor, value in begun.state_dict().items():
        _, of_cameras, own = tensor.partition(f"{path}.views.")
        assert torch.equal(value, theirs[own] if of_cameras else fresh[tensor]), tensor
    assert f"are those of `{trainee.pretrained.name}`" in "".join(trainee.about(begun))
    assert not [
        part for part in begun.train().modules() if part.training and part in eyes.views.modules()
    ]
    learning = {name for name, each in begun.named_parameters() if each.requires_grad}
    assert learning
    assert not [name for name in learning if name.startswith(f"{path}.views.")]


def test_whose_cameras_it_has_is_part_of_what_is_trained(drives, tmp_path):
    plan = TrainingPlan(
        policy=config_named("vad"),
        training=TrainConfig(steps=1, batch=1),
        data=(drives,),
        folder=tmp_path,
    )
    session = begin(plan, ALONE, "cpu")
    trainee = session.training.trainee
    assert session.training.config.init_from == weights_digest(trainee.pretrained)


@pytest.mark.parametrize("untrained", NAMES, indirect=True)
def test_weights_are_stored_small_and_come_back(untrained):
    network, folder = untrained
    assert sum(parameter.numel() for parameter in network.parameters()) <= MOST_PARAMETERS
    loaded = load_system(folder)
    assert loaded.config == network.config
    for name, value in network.state_dict().items():
        assert torch.equal(loaded.state_dict()[name], on_disk(value)), name


@pytest.mark.parametrize("untrained", NAMES, indirect=True)
def test_it_drives_one_decision_and_says_why(untrained, observation):
    network, folder = untrained
    agent = load_agent(f"zoo:{folder}")
    memory = agent.start(None, seed=0)
    control, after = agent.act(observation, memory)
    assert control.shape == (3,)
    assert after.decision == 1
    again, _ = agent.act(observation, memory)
    assert (again == control).all()
    look = look_at(agent, observation, memory)
    assert look.response.waypoints.shape == (network.config.waypoints, 2)
    assert set(look.response.groups) == set(network.anatomy.groups)
    assert look.response.groups or look.maps
    assert all((part >= 0.0).all() for part in look.maps.values())


@pytest.mark.parametrize("untrained", NAMES, indirect=True)
def test_it_says_why_of_a_decision_that_rests_on_what_it_remembers(untrained, observation):
    agent = load_agent(f"zoo:{untrained[1]}")
    memory = agent.start(None, seed=0)
    for _ in range(5):  # 0.5 s: what it then remembers is of a moment before
        _, memory = agent.act(observation, memory)
    output = agent.decide(observation, memory)
    look = look_at(agent, observation, memory)
    assert torch.equal(torch.from_numpy(look.response.waypoints), output.waypoints[0].detach())
    assert all((part >= 0.0).all() for part in look.maps.values())


@pytest.mark.parametrize("name", NAMES)
def test_a_system_without_weights_says_how_to_train_it(name, monkeypatch):
    monkeypatch.setitem(AGENTS, name, dataclasses.replace(AGENTS[name], data="zoo/not-there"))
    with pytest.raises(AgentSpecError, match="not trained yet: driveinsight train --recipe reci"):
        load_agent(name)


def test_a_configuration_comes_back_from_its_values():
    for name in NAMES:
        config = config_named(name)
        assert trainee_from(config.to_mapping()).config == config


def test_a_hidden_component_is_told_as_zeros(observation):
    config = config_named("ego-only")
    told = inputs_of(config, observation)
    assert set(told) == {"target_point", "command", "speed"}
    assert told["target_point"].abs().sum() > 0.0
    hidden = {**observation, "prompt_present": 0 * observation["prompt_present"]}
    assert not any(value.any() for value in inputs_of(config, hidden).values())


def test_batches_of_a_system_put_moments_and_labels_side_by_side(drives):
    drive = read_drive(drive_paths(drives)[0])
    renderer = trainee_of(config_named("roach-raster")).renderer(*town_of(drive))
    samples = [renderer.sample(drive, last, NO_VARIATION, 1, past=0) for last in (4, 6)]
    batch = batch_of(samples)
    assert batch.inputs[0]["raster"].shape[0] == 2
    assert batch.targets["waypoints"].shape == (2, 4, 2)
    assert batch.targets["action"].shape == (2, 2)


def test_weights_of_another_size_are_refused(tmp_path):
    config = config_named("ego-only")
    save_system(network_of(config), tmp_path, "a card")
    save_system(network_of(dataclasses.replace(config, width=64)), tmp_path / "other", "a card")
    (tmp_path / "other" / "config.json").replace(tmp_path / "config.json")
    with pytest.raises(WeightsError, match="does not fit"):
        load_system(tmp_path)
