"""The eyes: what a LiDAR map counts, what rows are read off maps, what is asked of them."""

from __future__ import annotations

import math

import pytest
import torch

from agents.driveinsight.config import LidarEncoderConfig
from agents.driveinsight.heads import BOX, SPEED_MPS, Heads, ObjectClass
from agents.driveinsight.lidar import Pillars
from agents.driveinsight.perception_losses import (
    IGNORED,
    PerceptionTargets,
    PerceptionWeights,
    object_heat,
    perception_losses,
)
from agents.driveinsight.reading import read_seen
from agents.driveinsight.seen import OBJECTS, SIGNALS
from agents.driveinsight.semantics import BevClass
from agents.networks.grid import GridConfig
from di_envs.world.kinds import ActorKind

GRID = GridConfig(x_min_m=-8.0, x_max_m=24.0, y_min_m=-16.0, y_max_m=16.0, cells=32)  # of 1 m


def blank_heads() -> Heads:
    """Heads that see nothing, and are sure of it."""
    half = GRID.cells // 2
    where = torch.zeros(1, half * half + 1)
    where[:, -1] = 20.0
    return Heads(
        semantics=torch.zeros(1, len(BevClass), 32, 32),
        heat=torch.full((1, 3, 32, 32), -10.0),
        boxes=torch.zeros(1, BOX, 32, 32),
        where=where,
        line=torch.zeros(1, 4, half, half),
        state=torch.zeros(1, 4),
        lamps=None,
    )


def with_object(heads, class_, cell, box, logit=4.0):
    heads.heat[0, class_, cell[0], cell[1]] = logit
    heads.boxes[0, :, cell[0], cell[1]] = torch.tensor(box)


def test_points_are_counted_in_half_cells_and_slices_of_height():
    config = LidarEncoderConfig(heights_m=(-1.0, 0.5, 2.0))
    points = torch.zeros(1, 6, 4)
    # 10.3 m ahead, 2.6 m to the left: (18.3 x 2, 13.4 x 2) = pillar (36, 26)
    points[0, 0] = torch.tensor([10.3, -2.6, 0.1, 0.8])
    points[0, 1] = torch.tensor([10.4, -2.7, 1.0, 0.6])
    points[0, 2] = torch.tensor([10.3, -2.6, 1.5, 0.4])
    points[0, 3] = torch.tensor([10.3, -2.6, 3.0, 0.5])  # above all slices
    points[0, 4] = torch.tensor([24.1, 0.0, 1.0, 0.5])  # beyond the grid; the last row is no point
    out = Pillars(config, GRID)(points)
    assert out.shape == (1, 4, 64, 64)
    expected = [math.log(2.0), math.log(3.0), 2.5 / 4.0, 0.6]
    assert out[0, :, 36, 26].tolist() == pytest.approx(expected)
    assert (out.abs().sum(dim=1) > 0.0).sum() == 1


def test_nothing_seen_gives_empty_rows():
    seen = read_seen(blank_heads(), GRID)
    assert seen.objects.shape == (1, OBJECTS, 9)
    assert not seen.objects.any()
    assert seen.signals.shape == (1, SIGNALS, 8)
    assert float(seen.signals[0, :, 7].max()) < 1e-3


def test_a_peak_becomes_a_row_of_place_heading_size_and_velocity():
    heads = blank_heads()
    box = [0.25, -0.5, math.log(4.5), math.log(2.0), 1.0, 0.0, 0.0, 0.6]
    with_object(heads, ObjectClass.BICYCLE, (20, 12), box)
    row = read_seen(heads, GRID).objects[0, 0]
    # Cell 20 is centred at -8 + 20.5 = 12.5 m, cell 12 at -16 + 12.5 = -3.5 m
    score = 1.0 / (1.0 + math.exp(-4.0))
    expected = [12.75, -4.0, math.pi / 2, 4.5, 2.0, 0.0, 0.6 * SPEED_MPS]
    assert row.tolist() == pytest.approx([*expected, ActorKind.BICYCLE, score], abs=1e-4)


def test_of_two_peaks_too_near_each_other_the_higher_one_counts():
    heads = blank_heads()
    with_object(heads, ObjectClass.VEHICLE, (20, 12), [0.0] * BOX, logit=3.0)
    with_object(heads, ObjectClass.VEHICLE, (21, 12), [0.0] * BOX, logit=2.0)
    with_object(heads, ObjectClass.VEHICLE, (26, 12), [0.0] * BOX, logit=1.0)
    found = read_seen(heads, GRID).objects[0]
    assert found[:, 0].tolist()[:3] == [12.5, 18.5, 0.0]
    assert found[0, 8] > found[1, 8] > found[2, 8]


def test_what_is_read_has_gradients_to_what_was_said():
    heads = blank_heads()
    with_object(heads, ObjectClass.WALKER, (20, 12), [0.0] * BOX)
    heads.where[0, 5] = 21.0
    for value in (heads.heat, heads.boxes, heads.where, heads.line, heads.state):
        value.requires_grad_()
    seen = read_seen(heads, GRID)
    (seen.objects.sum() + (seen.signals * torch.arange(1.0, 9.0)).sum()).backward()
    for value in (heads.heat, heads.boxes, heads.where, heads.line, heads.state):
        assert value.grad.abs().sum() > 0.0


def test_the_governing_line_is_read_where_it_is_likeliest():
    heads = blank_heads()
    # of the 16 x 16 cells of 2 m: (10, 7) is centred at -8 + 21 = 13 m and -16 + 15 = -1 m
    heads.where[0, 10 * 16 + 7] = 24.0
    heads.line[0, :, 10, 7] = torch.tensor([0.25, 0.1, 0.0, 1.0])
    heads.state[0] = torch.tensor([0.0, 0.0, 9.0, 0.0])
    row = read_seen(heads, GRID).signals[0, 0]
    assert row[:3].tolist() == pytest.approx([13.5, -0.8, 0.0], abs=1e-3)
    assert row[3:7].argmax() == 2
    assert float(row[7]) == pytest.approx(1.0 / (1.0 + math.exp(-4.0)), abs=1e-3)


def truth_of(row, signal=None) -> PerceptionTargets:
    semantics = torch.zeros(1, 32, 32, dtype=torch.uint8)
    return PerceptionTargets(
        semantics=semantics,
        objects=torch.tensor([[row]]),
        signal=torch.tensor([signal or [0.0] * 8]),
        lamps=None,
    )


ROW = [12.75, -4.0, math.pi / 2, 4.5, 2.0, 0.0, 6.0, float(ActorKind.BICYCLE), 1.0]


def test_the_heat_wanted_is_one_in_the_cell_of_the_middle_and_falls_beside_it():
    wanted, ignored = object_heat(torch.tensor([[ROW]]), GRID)
    assert wanted[0, ObjectClass.BICYCLE, 20, 12] == 1.0
    assert 0.0 < float(wanted[0, ObjectClass.BICYCLE, 21, 12]) < 1.0
    assert float(wanted.sum(dim=(0, 2, 3))[ObjectClass.VEHICLE]) == 0.0
    assert not ignored.any()


def test_who_is_hidden_is_neither_wanted_nor_forbidden():
    hidden = [*ROW[:8], 0.0]
    wanted, ignored = object_heat(torch.tensor([[hidden]]), GRID)
    assert not wanted.any()
    assert ignored[0, ObjectClass.BICYCLE, 20, 12] == 1.0
    heads, weights = blank_heads(), PerceptionWeights()
    quiet = perception_losses(heads, (), truth_of(hidden), GRID, weights)
    with_object(heads, ObjectClass.BICYCLE, (20, 12), [9.0] * BOX)
    loud = perception_losses(heads, (), truth_of(hidden), GRID, weights)
    assert float(loud["heat"]) == pytest.approx(float(quiet["heat"]), abs=1e-3)
    assert float(loud["boxes"]) == 0.0


def test_heads_that_say_the_truth_cost_nearly_nothing_and_others_more():
    heads, weights = blank_heads(), PerceptionWeights()
    signal = [13.5, -0.8, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0]
    targets = truth_of(ROW, signal)
    wrong = perception_losses(heads, (), targets, GRID, weights)
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            offset = [0.25 - dx, -0.5 - dy]
            box = [*offset, math.log(4.5), math.log(2.0), 1.0, 0.0, 0.0, 0.6]
            heads.boxes[0, :, 20 + dx, 12 + dy] = torch.tensor(box)
            line = torch.tensor([0.25 - dx, 0.1 - dy, 0.0, 1.0])
            heads.line[0, :, 10 + dx, 7 + dy] = line
    heads.heat[0, ObjectClass.BICYCLE, 20, 12] = 8.0
    heads.where[0, 10 * 16 + 7] = 40.0
    heads.state[0, 2] = 20.0
    heads.semantics[0, 0] = 20.0
    right = perception_losses(heads, (), targets, GRID, weights)
    for name, value in right.items():
        assert float(value) < 0.01, name
        assert float(wrong[name]) > 0.1, name


def test_nothing_is_asked_of_cells_that_are_ignored():
    targets = truth_of(ROW)
    targets.semantics[0, 3, 3] = IGNORED
    heads = blank_heads()
    before = perception_losses(heads, (), targets, GRID, PerceptionWeights())["semantics"]
    heads.semantics[0, int(BevClass.WALKER), 3, 3] = 50.0
    after = perception_losses(heads, (), targets, GRID, PerceptionWeights())["semantics"]
    assert torch.equal(before, after)
