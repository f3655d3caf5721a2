"""Parts of systems that arithmetic can check: points in pictures, density maps, the raster."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from agents import AgentSpecError
from agents.training.frames import DriveStage
from agents.zoo.ego_only.config import EgoOnlyConfig
from agents.zoo.interfuser.losses import density_map, traffic_state
from agents.zoo.lbc.points import (
    SpatialSoftmax,
    heat_of,
    metres_of_grid,
    metres_of_image,
    share_of_grid,
    share_of_image,
)
from agents.zoo.ppo.agent import PpoAgent
from agents.zoo.raster import GRID, RasterChannel, true_raster
from agents.zoo.registry import config_of, network_of
from agents.zoo.roach_raster.config import RoachConfig
from agents.zoo.system import FAMILY, SystemConfig
from agents.zoo.transfuser.config import TransfuserConfig
from di_envs.route_env import RouteEnv
from di_envs.town.lanes import SignalKind
from di_envs.world.kinds import ActorKind

FRONT = FAMILY.cameras[0]


def test_a_place_on_the_ground_is_shown_where_the_camera_projects_it():
    place = torch.tensor([[9.3, 2.0]])
    column, row, _ = FRONT.project(torch.tensor([[9.3, 2.0, 0.0]]).double().numpy())[0]
    shown = share_of_image(place, FRONT)[0]
    assert shown.tolist() == pytest.approx([row / FRONT.height, column / FRONT.width], abs=1e-6)
    assert metres_of_image(shown, FRONT).tolist() == pytest.approx([9.3, 2.0], abs=1e-4)


def test_a_place_at_the_car_is_brought_to_where_the_picture_begins():
    back = metres_of_image(share_of_image(torch.zeros(1, 2), FRONT), FRONT)[0]
    assert 2.0 < back[0] < 3.0
    assert back[1] == pytest.approx(0.0, abs=1e-4)


def test_shares_of_the_grid_and_back():
    place = torch.tensor([16.0, -12.0])
    assert share_of_grid(place, GRID).tolist() == [0.5, 0.25]
    assert metres_of_grid(torch.tensor([0.5, 0.25]), GRID).tolist() == [16.0, -12.0]


def test_the_place_of_one_hot_cell_is_its_middle():
    heat = torch.zeros(1, 1, 4, 8)
    heat[0, 0, 2, 5] = 100.0
    assert SpatialSoftmax()(heat)[0, 0].tolist() == pytest.approx([2.5 / 4, 5.5 / 8])


def test_a_drawn_target_is_brightest_where_it_is():
    heat = heat_of(torch.tensor([[2.5 / 4, 5.5 / 8]]), 4, 8, 1.0)[0, 0]
    assert heat[2, 5] == heat.max() == 1.0


def test_objects_are_told_in_the_cells_that_they_stand_in():
    objects = torch.zeros(1, 3, 9)
    objects[0, 0] = torch.tensor([7.7, 2.4, 0.0, 4.0, 2.0, 3.0, 4.0, 0.0, 1.0])
    objects[0, 1] = torch.tensor([3.5, -4.5, 0.0, 4.0, 2.0, 0.0, 0.0, 0.0, -1.0])  # hidden
    objects[0, 2] = torch.tensor([33.0, 0.0, 0.0, 4.0, 2.0, 0.0, 0.0, 0.0, 1.0])  # too far
    rows, known = density_map(objects, 20)
    assert rows[0, :, 0].nonzero().tolist() == [[7 * 20 + 12]]
    told = rows[0, 7 * 20 + 12].tolist()
    assert told == pytest.approx([1.0, 0.2, -0.1, 1.3863, 0.6931, 0.0, 1.0, 0.5], abs=1e-4)
    assert (1.0 - known[0]).nonzero().tolist() == [[3 * 20 + 5]]


def test_a_line_far_ahead_is_not_asked_for():
    near = torch.tensor([[12.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]])
    state, asked = traffic_state(torch.cat([near, near + torch.tensor([30.0] + [0.0] * 7)]))
    assert state.tolist() == [[1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
    assert asked.tolist() == [1.0, 0.0]


def test_a_students_teacher_stays_as_it_is():
    student = network_of(config_of("lbc")).train()
    assert student.student.training
    assert not student.teacher.training
    assert not any(parameter.requires_grad for parameter in student.teacher.parameters())
    names = set(network_of(config_of("lbc-teacher")).state_dict())
    assert names <= set(student.state_dict())


@pytest.mark.parametrize(
    ("field", "message"),
    [
        ({"cameras": ("camera_frnot",)}, "did you mean 'camera_front'"),
        ({"told": ("sped",)}, "did you mean 'speed'"),
        ({"labels": ("rastr",)}, "did you mean 'raster'"),
        ({"lidar": "papr"}, "did you mean 'paper'"),
        ({"past": 9}, "past must be from 0 to 8"),
    ],
)
def test_a_system_that_asks_for_what_there_is_not_is_told_so(field, message):
    with pytest.raises(ValueError, match=message):
        SystemConfig(system="ego-only", **field)


def test_sizes_that_do_not_go_together_are_refused():
    with pytest.raises(ValueError, match="4 heads do not share a width of 10 evenly"):
        TransfuserConfig(width=10)
    with pytest.raises(ValueError, match="width must be from 1 to 4096, not 0"):
        EgoOnlyConfig(width=0)
    with pytest.raises(ValueError, match="widths must be from 1 to 4096, not -3"):
        RoachConfig(widths=(16, -3))


def test_ppo_without_its_model_says_how_to_make_one(monkeypatch):
    monkeypatch.setattr("agents.zoo.ppo.agent.MODEL_FILE", "other.zip")
    with pytest.raises(AgentSpecError, match=r"not trained yet: python examples/train_ppo\.py"):
        PpoAgent(shipped="ppo")


def test_a_stop_sign_is_drawn_until_the_ego_has_stopped_for_it():
    env = RouteEnv(suite="town05_short", observations=("prompt",), traffic=0, walkers=0)
    observation, _ = env.reset(seed=0, options={"route": "12"})
    stage = DriveStage(env.view.town, env.plan, env.view.capacity)
    state, signals = stage.view.state, stage.view.town.signals
    (sign, *_) = np.flatnonzero(signals.kind[signals.stop_signal] == SignalKind.STOP)
    x, y, z, yaw = signals.stop_pose[sign]
    state.x[0], state.y[0], state.z[0] = x - 8.0 * np.cos(yaw), y - 8.0 * np.sin(yaw), z
    state.yaw[0], state.kind[0], state.stop_target[0] = yaw, ActorKind.CAR, -1

    def drawn():
        return true_raster(stage.view, observation["routing"])[RasterChannel.STOP_SIGN].any()

    assert drawn()
    state.stop_target[0] = signals.stop_signal[sign]
    assert drawn()
    state.stop_done[0] = 1
    assert not drawn()
