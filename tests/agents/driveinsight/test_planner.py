"""The planner: what it looks at, and that no component tells another."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import pytest
import torch

from agents.driveinsight.bev_tokens import way_points
from agents.driveinsight.config import TOKENS, PlannerConfig, config_named
from agents.driveinsight.explained import anatomy_of
from agents.driveinsight.model import Policy
from agents.driveinsight.rows import signals_of_lights, signals_of_signs
from agents.driveinsight.seen import OBJECTS, SIGNALS, Seen
from agents.networks.taps import watching
from di_envs.prompt import COMPONENTS
from di_envs.town.lanes import LightState
from tests.agents.driveinsight.random_inputs import awake, random_inputs

PLANNERS = {
    "pooled": PlannerConfig(width=24, heads=2, layers=2),
    "pooled and next": PlannerConfig(width=24, heads=2, layers=2, next_row=True),
    "rows": PlannerConfig(
        width=24, heads=2, layers=2, each_row=True, each_waypoint=True, mixing_layers=1
    ),
}


@pytest.fixture(params=PLANNERS)
def policy(request):
    """A whole policy that is handed rows, so that its sensors need not look."""
    torch.manual_seed(0)
    whole = config_named("driveinsight")
    config = dataclasses.replace(whole, camera=None, planner=PLANNERS[request.param])
    return awake(Policy(config)).eval()


def inputs_with_rows(policy, batch=2, seed=0):
    """Random prompts and random rows that are seen."""
    blind = dataclasses.replace(policy.config, camera=None, lidar=None)
    draw = torch.Generator().manual_seed(seed)
    objects = torch.rand(batch, OBJECTS, 9, generator=draw)
    objects[..., :2] = objects[..., :2] * 60.0 - 10.0
    objects[..., 7] = 1.0
    signals = torch.rand(batch, SIGNALS, 8, generator=draw)
    return dataclasses.replace(
        random_inputs(blind, batch=batch, seed=seed), seen=Seen(objects=objects, signals=signals)
    )


def planned(policy, inputs):
    with torch.inference_mode():
        return policy(inputs).waypoints


def test_who_hands_in_rows_needs_no_sensors(policy):
    assert planned(policy, inputs_with_rows(policy)).shape == (2, 8, 2)


def test_hiding_the_route_hides_all_that_is_derived_from_it(policy):
    inputs = inputs_with_rows(policy)
    inputs.present[:, TOKENS.index("routing")] = 0.0
    other = inputs_with_rows(policy, seed=5).prompt["routing"]
    changed = dataclasses.replace(inputs, prompt={**inputs.prompt, "routing": other})
    assert torch.equal(planned(policy, inputs), planned(policy, changed))
    # and a route that is told does make a difference to what the others say
    tap = "prompt.taps.obstacles"
    with torch.inference_mode(), watching(policy, tap, "bev.tokens") as seen:
        for routing in (inputs.prompt["routing"], other):
            prompt = {**inputs.prompt, "routing": routing}
            policy(dataclasses.replace(inputs, prompt=prompt, present=torch.ones(2, len(TOKENS))))
    for first, second in seen.values():
        assert not torch.equal(first, second)


@pytest.mark.parametrize("component", TOKENS)
def test_a_hidden_component_is_zero_tokens_and_makes_no_difference(policy, component):
    inputs = inputs_with_rows(policy)
    inputs.present[:, TOKENS.index(component)] = 0.0
    other = inputs_with_rows(policy, seed=9)
    if component == "bev":
        changed = dataclasses.replace(inputs, seen=other.seen)
    else:
        prompt = {**inputs.prompt, component: other.prompt[component]}
        changed = dataclasses.replace(inputs, prompt=prompt)
    tap = "bev.tokens" if component == "bev" else f"prompt.taps.{component}"
    with torch.inference_mode(), watching(policy, tap) as seen:
        assert torch.equal(policy(inputs).waypoints, policy(changed).waypoints)
    assert not seen[tap][0].any()


def test_who_is_seen_is_encoded_as_who_is_told(policy):
    inputs = inputs_with_rows(policy)
    rows = inputs.prompt["obstacles"][:, :OBJECTS]
    told = {**inputs.prompt, "obstacles": rows}
    seen = Seen(objects=rows, signals=inputs.seen.signals)
    with torch.inference_mode(), watching(policy, "prompt.taps.obstacles", "bev.tokens") as taps:
        policy(dataclasses.replace(inputs, prompt=told, seen=seen))
    obstacles, bev = taps["prompt.taps.obstacles"][0], taps["bev.tokens"][0]
    assert torch.allclose(bev[:, : obstacles.shape[1]], obstacles)


def test_told_lights_and_signs_have_the_columns_of_seen_signals():
    lights = torch.tensor([[[20.0, 1.0, 0.1, float(LightState.YELLOW), 1.0]]])
    assert signals_of_lights(lights)[0, 0].tolist() == pytest.approx([20, 1, 0.1, 0, 1, 0, 0, 1])
    signs = torch.tensor([[[9.0, -2.0, 0.0, 1.0]]])
    assert signals_of_signs(signs)[0, 0].tolist() == [9.0, -2.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0]


def test_features_are_looked_up_along_the_route_and_straight_ahead_where_none_is_told():
    routing = torch.zeros(2, 50, 4)
    routing[0, :, 1] = torch.arange(1, 51)  # to the right, all the way
    routing[0, :, 2] = torch.pi / 2
    routing[0, :, 3] = 1.0
    along, ahead = way_points(routing, 3)
    assert torch.allclose(along[1], torch.tensor([[3.5, 8.0], [0.0, 8.0], [-3.5, 8.0]]), atol=1e-5)
    assert torch.allclose(ahead[2], torch.tensor([[12.0, -3.5], [12.0, 0.0], [12.0, 3.5]]))


def test_features_begin_by_saying_nothing_so_a_planner_goes_on_as_it_was():
    torch.manual_seed(0)
    config = dataclasses.replace(config_named("driveinsight"), camera=None)
    policy = Policy(config).eval()
    inputs = inputs_with_rows(policy, batch=1)
    present = torch.ones(1, len(TOKENS))
    bev = torch.randn(1, config.bev_width, config.grid.cells, config.grid.cells)
    with torch.inference_mode():
        alone = policy.plan(inputs.prompt, present, inputs.seen, None)
        beside = policy.plan(inputs.prompt, present, inputs.seen, bev)
    assert torch.equal(alone, beside)


def test_the_anatomy_names_each_components_keys_one_after_the_other(policy):
    groups = anatomy_of(policy.config).groups
    assert tuple(groups) == TOKENS
    ends = [group.keys for group in groups.values()]
    assert ends[0][0] == 0
    assert all(one[1] == other[0] for one, other in pairwise(ends))
    taps = {name: f"prompt.taps.{name}" for name in COMPONENTS} | {"bev": "bev.tokens"}
    weights = anatomy_of(policy.config).attention[0]
    with torch.inference_mode(), watching(policy, weights, *taps.values()) as seen:
        policy(inputs_with_rows(policy))
    for name, group in groups.items():
        assert seen[taps[name]][0].shape[1] == group.keys[1] - group.keys[0], name
    assert seen[weights][0].shape[3] == ends[-1][1]
