"""Edits inside the policy, and what dropping a component is: its token behind its encoder, zero."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from agents.driveinsight.agent import DriveInsightAgent
from agents.driveinsight.config import PolicyConfig, config_named
from agents.driveinsight.inputs import inputs_of
from agents.driveinsight.model import Policy
from agents.driveinsight.tap_edits import DecisionMoment, EditedDecision, TapEdit
from agents.driveinsight.weights import save_pretrained
from agents.networks.taps import editing, watching
from di_envs.edits.text import EditError, read_edits
from di_envs.observation import observation_space
from di_envs.prompt import COMPONENTS
from tests.agents.driveinsight.random_inputs import awake, random_inputs
from wrappers.interventions import ObservationEditing
from wrappers.interventions.context import EditContext

NOW = DecisionMoment(seed=3, decision=60, time_s=6.0)


def made(config: PolicyConfig) -> Policy:
    torch.manual_seed(0)
    return awake(Policy(config)).eval()


@pytest.fixture(scope="module")
def prompted() -> Policy:
    return made(config_named("driveinsight-told"))


@pytest.fixture(scope="module")
def seeing() -> Policy:
    return made(dataclasses.replace(config_named("driveinsight"), camera=None))


def read(text, policy):
    return [each for edit in read_edits(text) for each in TapEdit.of(edit, policy)]


def planned(policy, inputs, text="", moment=NOW):
    edited = EditedDecision(read(text, policy), moment)
    with torch.inference_mode(), edited.of(policy), watching(policy) as seen:
        waypoints = policy(inputs).waypoints
    return waypoints, {name: passed[0] for name, passed in seen.items()}


def shown(observation, text):
    space = observation_space(("prompt",))
    context = EditContext(
        seed=1, tick=4, decision=2, time_s=0.2, route_completion=1.0, junction_m=9.0
    )
    editing = ObservationEditing(text, space)
    return editing.apply(observation, context, editing.start())[0]


@pytest.mark.parametrize("component", COMPONENTS)
def test_drop_is_the_policys_zero_token_to_the_bit_and_zero_is_not(prompted, component):
    inputs = random_inputs(prompted.config)
    observation = {name: value[0].numpy() for name, value in inputs.prompt.items()}
    observation["command"] = np.int64(2)
    observation["prompt_present"] = np.ones(len(COMPONENTS), np.int8)
    tap = f"prompt.taps.{component}"
    tokens = {}
    for verb in ("identity", "drop", "zero"):
        edited = inputs_of(prompted.config, shown(observation, f"{verb}:{component}"))
        waypoints, seen = planned(prompted, edited)
        tokens[verb] = (waypoints, seen[tap])
    assert not tokens["drop"][1].any()
    assert tokens["zero"][1].any()
    # As training's dropout does it: the token is zero behind its encoder, whatever it encodes, and
    # without a route nobody is told where they are along it.
    whole = inputs_of(prompted.config, observation)
    kept = {} if component == "routing" else {tap: torch.zeros_like}
    given = whole.present.clone()
    given[:, COMPONENTS.index(component)] = float(component != "routing")
    with torch.inference_mode(), editing(prompted, kept):
        dropped_out = prompted(dataclasses.replace(whole, present=given)).waypoints
    assert torch.equal(tokens["drop"][0], dropped_out)
    assert not torch.equal(tokens["zero"][0], dropped_out)
    assert torch.equal(tokens["identity"][0], planned(prompted, whole)[0])


def test_dropped_bev_is_bev_that_is_not_present(seeing):
    inputs = random_inputs(seeing.config)
    present = inputs.present.clone()
    present[:, -1] = 0.0
    with torch.inference_mode():
        absent = seeing(type(inputs)(**{**vars(inputs), "present": present})).waypoints
    assert torch.equal(planned(seeing, inputs, "drop:bev")[0], absent)
    assert not torch.equal(planned(seeing, inputs, "zero:bev")[0], absent)


def test_an_edit_that_edits_nothing_changes_no_bit(seeing):
    inputs = random_inputs(seeing.config)
    plain = planned(seeing, inputs)[0]
    for text in ("identity:bev", "mask:bev,p=0", "zero:bev@t>9", "noise:waypoints,sigma=0"):
        assert torch.equal(planned(seeing, inputs, text)[0], plain)


def test_a_masked_map_loses_whole_cells_and_that_share_of_them(seeing):
    inputs = random_inputs(seeing.config)
    _, plain = planned(seeing, inputs)
    _, masked = planned(seeing, inputs, "mask:bev,p=0.3")
    before, after = plain["perception.memory.bev"][0], masked["perception.memory.bev"][0]
    lost = (after == 0).all(dim=0)
    assert torch.equal(after[:, ~lost], before[:, ~lost])
    assert lost.float().mean() == pytest.approx(0.3, abs=0.05)


@pytest.mark.parametrize(("text", "shown"), [
    ("delay:bev,steps=2", [0, 0, 0, 1]),
    ("delay:bev,steps=0", [0, 1, 2, 3]),
    ("delay:bev,steps=2@t>0.25", [0, 1, 2, 1]),
])  # fmt: skip
def test_a_delay_shows_the_planner_what_was_seen_that_many_decisions_ago(seeing, text, shown):
    decisions = [random_inputs(seeing.config, seed=seed) for seed in range(4)]
    tokens = [planned(seeing, inputs)[1]["bev.tokens"] for inputs in decisions]
    edits, passed = read(text, seeing), ()
    for number, inputs in enumerate(decisions):
        moment = DecisionMoment(seed=3, decision=number, time_s=number * 0.1)
        delayed = EditedDecision(edits, moment, passed)
        with torch.inference_mode():
            with delayed.of(seeing):
                got = seeing(inputs).waypoints
            with editing(seeing, {"bev.tokens": lambda _, old=tokens[shown[number]]: old}):
                assert torch.equal(got, seeing(inputs).waypoints)
        passed = delayed.passed


def test_draws_are_keyed_by_the_seed_and_the_decision(seeing):
    inputs = random_inputs(seeing.config)

    def noisy(seed, decision):
        moment = DecisionMoment(seed=seed, decision=decision, time_s=1.0)
        return planned(seeing, inputs, "noise:waypoints,sigma=1", moment)[0]

    assert torch.equal(noisy(3, 60), noisy(3, 60))
    assert not torch.equal(noisy(3, 60), noisy(3, 61))
    assert not torch.equal(noisy(3, 60), noisy(4, 60))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mask:bevv,p=0.3", "Unknown tap of the policy 'bevv'"),
        ("mask:bev", "write mask:bev,p=0.3"),
        ("delay:bev", "write delay:bev,steps=50"),
        ("delay:bev,steps=2.5", "steps is a whole number, not 2.5"),
        ("delay:bev,steps=-1", r"steps lies in \[0, inf\], not -1"),
        ("mask:bev,p=2", r"p lies in \[0, 1\], not 2"),
        ("blackout:bev", "Unknown edit of an activation 'blackout'"),
        ("zero:bev@junction<9", "inside a policy only t is known"),
    ],
)
def test_what_cannot_be_done_inside_is_refused(seeing, text, message):
    with pytest.raises(EditError, match=message):
        read(text, seeing)


def test_a_policy_without_bev_has_none_to_edit(prompted):
    with pytest.raises(EditError, match="Unknown tap of the policy 'bev'"):
        read("mask:bev,p=0.3", prompted)


@pytest.mark.parametrize(
    "edit", ["noise:waypoints,sigma=5@t>0.05", "delay:waypoints,steps=1@t>0.05"]
)
def test_an_edited_agent_acts_otherwise_and_leaves_the_first_as_it_was(prompted, edit, tmp_path):
    save_pretrained(prompted, tmp_path, card="Not trained.")
    agent = DriveInsightAgent(weights=tmp_path)
    inputs = random_inputs(prompted.config)
    observation = {name: value[0].numpy() for name, value in inputs.prompt.items()}
    observation["prompt_present"] = np.ones(len(COMPONENTS), np.int8)
    edited = agent.edited(read_edits(edit))
    seen = []
    for driver in (agent, edited, agent, edited):
        memory, plans = driver.start(None, 5), []
        for speed in (0.0, 4.0, 8.0):
            observation["speed"] = np.array([speed], np.float32)
            plans.append(driver.plan(observation, memory).waypoints.detach().numpy())
            _, memory = driver.act(observation, memory)
        seen.append(np.array(plans))
    assert np.array_equal(seen[0], seen[2])
    assert np.array_equal(seen[1], seen[3])
    assert np.array_equal(seen[0][0], seen[1][0])  # 0.05 s have not passed yet
    assert not np.array_equal(seen[0][1:], seen[1][1:])
