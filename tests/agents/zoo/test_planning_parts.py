"""Parts of the systems that plan on maps of the ground, by arithmetic."""

from __future__ import annotations

import pytest
import torch

from agents.networks.looking import features_at
from agents.zoo.commands import command_of
from agents.zoo.driveadapter.masks import drawn_route
from agents.zoo.eyes import BEV
from agents.zoo.mile.model import balanced_kl
from agents.zoo.raster import GRID
from agents.zoo.registry import config_of, network_of
from agents.zoo.st_p3.paths import ACCELERATIONS_MPS2, CURVATURES, path_costs, sampled_paths
from agents.zoo.thinktwice.config import ThinkTwiceConfig
from agents.zoo.thinktwice.thinking import Plan, ThinkingAgain
from agents.zoo.two_heads import TwoHeads
from agents.zoo.vad.losses import boundary, collision, matched
from di_envs.town.map_chunks import MapKind
from di_envs.town.plan import RoadOption

NEITHER = torch.tensor([[0.0, 0.0, 1.0]])


def test_changes_of_lane_count_as_turns_and_no_command_as_neither():
    options = (RoadOption.LEFT, RoadOption.CHANGELANERIGHT, RoadOption.LANEFOLLOW, RoadOption.VOID)
    chosen = command_of(torch.tensor([int(option) for option in options]))
    assert chosen.argmax(dim=1).tolist() == [0, 1, 2, 2]
    assert chosen.sum(dim=1).tolist() == [1.0] * 4


def test_features_are_looked_up_in_the_cell_that_a_place_lies_in():
    features = torch.zeros(1, 2, BEV.cells, BEV.cells)
    features[0, 1, 18, 20] = 3.0  # x 10 to 11 m, y -4 to -3 m
    found = features_at(features, torch.tensor([[[10.5, -3.5], [12.5, -3.5], [90.0, 0.0]]]), BEV)
    assert found[0].tolist() == [pytest.approx([0.0, 3.0], abs=1e-4), [0.0, 0.0], [0.0, 0.0]]


def test_paths_go_on_at_a_speed_or_come_to_a_stand():
    paths = sampled_paths(torch.tensor([[8.0]]), NEITHER, 4)[0]
    paths = paths.unflatten(0, (len(ACCELERATIONS_MPS2), CURVATURES))
    straight = paths[:, CURVATURES // 2]  # (A, T, 2)
    steady, hard = ACCELERATIONS_MPS2.index(0.0), ACCELERATIONS_MPS2.index(-8.0)
    assert straight[steady, :, 0].tolist() == pytest.approx([4.0, 8.0, 12.0, 16.0])
    assert straight[hard, :, 0].tolist() == pytest.approx([3.0, 4.0, 4.0, 4.0])
    assert straight[..., 1].abs().max() < 1e-4
    # a curve of 1/0.06 m to the right, after 16 m
    x, y = paths[steady, -1, -1].tolist()
    assert (x, y) == pytest.approx((16.67 * 0.819, 16.67 * (1 - 0.5735)), abs=0.02)


def test_a_path_through_somebody_costs_more_than_one_that_stops():
    maps = torch.zeros(1, 4, 4, BEV.cells, BEV.cells)
    maps[:, :, 3] = 1.0  # road
    paths = torch.tensor([[[[4.0 * t, 0.0] for t in range(1, 5)], [[2.0, 0.0]] * 4]])
    _, free = path_costs(paths, torch.tensor([[8.0]]), maps)
    maps[:, :, 1, 17:22, 22:26] = 1.0
    _, blocked = path_costs(paths, torch.tensor([[8.0]]), maps)
    assert free[0, 0] < free[0, 1]
    assert blocked[0, 0] > blocked[0, 1]


def test_each_thing_gets_the_nearest_query_that_is_left():
    cost = torch.tensor([[[0.1, 0.2, 9.0], [0.5, 0.4, 9.0]]])  # two queries, three things
    query, got = matched(cost, torch.tensor([[True, True, True]]))
    assert query[0, :2].tolist() == [0, 1]
    assert got[0].tolist() == [True, True, False]


def test_a_plan_is_pushed_away_from_who_will_be_there_and_from_the_edge():
    plan = torch.tensor([[[5.0, 0.0], [10.0, 0.0]]])
    ways = torch.tensor([[6.0, 0.5], [20.0, 0.5]])[None, None, None]
    lines = torch.full((1, 1, 10, 2), 0.4)
    lines[0, 0, :, 0] = torch.linspace(0.0, 9.0, 10)
    kinds = torch.zeros(1, 1, len(MapKind))
    kinds[..., MapKind.SOLID_LINE] = 9.0
    said = {"mode": torch.zeros(1, 1, 1), "ways": ways, "presence": torch.full((1, 1), 9.0)}
    said |= {"kinds": kinds, "points": lines}
    # 1 m ahead and 0.5 m aside of 3 and 1.5, at one of two times
    assert float(collision(plan, said)) == pytest.approx(0.5 * (2.0 + 1.0))
    # pieces' middles at (4.5 or 5.5, 0.4) and at (8.5, 0.4)
    near = 1.0 - (0.5**2 + 0.4**2) ** 0.5
    assert float(boundary(plan, said)) == pytest.approx(0.5 * near, abs=1e-4)
    assert float(collision(plan, said | {"presence": torch.full((1, 1), -9.0)})) == 0.0


def test_a_route_is_drawn_where_its_points_are():
    routing = torch.zeros(1, 50, 4)
    routing[0, :5, 0], routing[0, :5, 3] = torch.arange(10.0, 15.0), 1.0
    mask = drawn_route(routing)[0]
    rows, columns = mask.nonzero().unbind(1)
    assert (rows.min() * 0.5 - 8.0, columns.min() * 0.5 - 24.0) == (8.5, -1.5)
    assert 0 < mask.sum() < 7.5 / 0.5 * 7


def test_equal_distributions_are_no_surprise():
    same = torch.randn(3, 8)
    assert float(balanced_kl(same, same)) == pytest.approx(0.0, abs=1e-5)
    assert float(balanced_kl(same, same + 1.0)) > 0.1


@pytest.mark.parametrize(
    ("action", "followed", "standing", "expected"),
    [
        ((0.5, 0.0), (0.7, 0.0, 0.0), 0, (0.6, 0.0, 0.0)),
        ((0.5, 0.2), (0.7, 0.0, 0.0), 0, (0.4, 0.2, 0.0)),
        ((-0.5, 0.0), (0.7, 0.0, 0.0), 0, (0.0, 0.0, 1.0)),
        ((0.5, 0.0), (0.0, 0.0, 1.0), 0, (0.0, 0.0, 1.0)),
        ((0.5, 0.0), (0.0, 0.0, 1.0), 11, (0.6, 0.0, 0.0)),
        ((-1.0, 0.0), (0.0, 0.0, 1.0), 11, (0.0, 0.0, 1.0)),
    ],
)
def test_either_head_brakes_until_it_has_stood_for_long(action, followed, standing, expected):
    heads = TwoHeads(throttle=(0.6, 0.4), fast_mps=(3.5, 1.5), stuck=10)
    control = heads.control(torch.tensor(action), torch.tensor(followed).numpy(), 1.0, standing)
    assert control.tolist() == pytest.approx(expected)


@pytest.mark.parametrize("name", ["thinktwice", "driveadapter"])
def test_a_teacher_inside_is_the_teacher_of_its_recipe_and_stays_as_it_is(name):
    network = network_of(config_of(name)).train()
    assert not network.teacher.training
    assert not any(parameter.requires_grad for parameter in network.teacher.parameters())
    theirs, ours = network_of(config_of("roach-raster")).state_dict(), network.state_dict()
    assert all(ours[key].shape == value.shape for key, value in theirs.items())


def test_who_thinks_again_has_nothing_to_mend_at_first():
    config = ThinkTwiceConfig()
    plan = Plan(waypoints=torch.rand(1, 4, 2), action=torch.zeros(1, 2))
    ground = torch.rand(1, config.rolled, BEV.cells // 2, BEV.cells // 2)
    thought = ThinkingAgain(config)(plan, torch.rand(1, config.width), ground)
    assert not thought.offsets.waypoints.any()
    assert thought.future.shape == (1, 4, *ground.shape[1:])


def test_a_world_model_goes_on_without_looking():
    network = network_of(config_of("mile")).eval()
    state = network({"speed": torch.zeros(1, 1)}, network._nothing({"speed": torch.zeros(1, 1)}))
    ground, later = network.imagined(state.state)
    assert ground.shape[2:] == (GRID.cells, GRID.cells)
    assert not torch.equal(later.state[0], state.state[0])
