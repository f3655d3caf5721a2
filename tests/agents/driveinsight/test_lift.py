"""Lift and splat puts what a pixel shows where arithmetic says that it is."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from agents.networks.grid import GridConfig
from agents.networks.lift import FrustumPooling, cells_of, frustum_points, growing_depths_m
from di_envs.sensors.camera.config import CameraConfig

# 64 x 32 pixels, 90 degrees: focal length 32 px, so 4 px are 1/8 m a metre ahead.
CAMERA = CameraConfig(name="camera_front", width=64, height=32, fov_deg=90.0, x_m=1.0, z_m=2.0)
DEPTHS = np.linspace(4.0, 20.0, 5)
GRID = GridConfig()


def pooled(camera, row, column, depth_bin):
    """A feature (3, 5) at one pixel, certain to lie at one depth, in the grid."""
    pooling = FrustumPooling([camera], 4, DEPTHS, GRID)
    features, depth = torch.zeros(1, 1, 2, 8, 16), torch.zeros(1, 1, 5, 8, 16)
    features[0, 0, :, row, column] = torch.tensor([3.0, 5.0])
    depth[0, 0, depth_bin, row, column] = 1.0
    return pooling(features, depth)[0]


def test_a_feature_12_m_ahead_falls_into_the_cell_that_arithmetic_gives():
    # Bin 2 of 4, 8, 12, 16, 20 is 12 m. Column 10 is centred 42 px from the left, 10 px right of
    # the axis: 10 / 32 x 12 m = 3.75 m to the right; x = 1 + 12 = 13 m. The cells are 0.8 m:
    # (13 + 8) / 0.8 = 26.25 and (3.75 + 19.2) / 0.8 = 28.69.
    bev = pooled(CAMERA, row=4, column=10, depth_bin=2)
    assert bev[:, 26, 28].tolist() == [3.0, 5.0]
    assert bev.sum() == 8.0


def test_a_camera_to_the_right_sees_to_the_right():
    turned = CameraConfig(
        name="camera_right", width=64, height=32, fov_deg=90.0, x_m=1.0, yaw_rad=math.pi / 2
    )
    # The same pixel at 8 m: y = 8, and 10 / 32 x 8 = 2.5 m to the camera's right, behind: x = -1.5.
    bev = pooled(turned, row=4, column=10, depth_bin=1)
    assert bev[:, int(6.5 / 0.8), int(27.2 / 0.8)].tolist() == [3.0, 5.0]


def test_what_is_deep_in_the_ground_or_out_of_range_is_left_out():
    # Row 7 is centred 30 px down, 14 px below the axis: at 16 m that is 7 m down from 2 m.
    assert pooled(CAMERA, row=7, column=8, depth_bin=3).sum() == 0.0
    # Column 15 is 30 px to the right: at 20 m that is 18.75 m right at x = 21 m, just inside.
    assert pooled(CAMERA, row=4, column=15, depth_bin=4).sum() == 8.0


def test_projecting_a_frustum_point_gives_its_pixel_back():
    points = frustum_points(CAMERA, 4, DEPTHS)  # (8, 16, 5, 3)
    seen = CAMERA.project(points[3, 11].astype(np.float64))
    assert seen[:, 0] == pytest.approx(46.0)
    assert seen[:, 1] == pytest.approx(14.0)
    assert seen[:, 2] == pytest.approx([4.0, 8.0, 12.0, 16.0, 20.0])


def test_pooling_is_the_sum_over_pixels_and_depths():
    pooling = FrustumPooling([CAMERA], 4, DEPTHS, GRID)
    draw = torch.Generator().manual_seed(1)
    features = torch.randn(2, 1, 2, 8, 16, generator=draw)
    depth = torch.rand(2, 1, 5, 8, 16, generator=draw)
    cell = cells_of(frustum_points(CAMERA, 4, DEPTHS), GRID)
    expected = torch.zeros(2, 2, 48, 48)
    for row, column, bin_ in np.ndindex(8, 16, 5):
        if (place := int(cell[row, column, bin_])) >= 0:
            value = features[:, 0, :, row, column] * depth[:, 0, bin_, row, column, None]
            expected[:, :, place // 48, place % 48] += value
    assert torch.allclose(pooling(features, depth), expected, atol=1e-5)


def test_depths_grow_by_even_steps_from_the_nearest_to_the_farthest():
    # 4 steps that grow evenly: 1, 2, 3 and 4 parts of 20 m, of 2 m each
    assert growing_depths_m(2.0, 22.0, 5) == pytest.approx([2.0, 4.0, 8.0, 14.0, 22.0])
