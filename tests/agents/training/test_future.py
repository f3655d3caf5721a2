"""What comes is where others were later in the drive, seen from where the ego is now."""

from __future__ import annotations

import numpy as np
import pytest

from agents.training.data_card import drive_paths
from agents.training.frames import DriveStage, read_drive
from agents.training.future import later_places, later_rasters
from agents.training.loading import town_of
from agents.zoo.raster import GRID, RasterChannel

NOW, STEPS = 4, 4


@pytest.fixture(scope="module")
def drive(drives):
    return read_drive(drive_paths(drives)[0])


@pytest.fixture(scope="module")
def stage(drive):
    town, plan_of = town_of(drive)
    stage = DriveStage(town, plan_of(str(drive.facts["route_id"])), drive.capacity)
    stage.set(drive, NOW)
    return stage


def places(drive, moment, actor):
    """(x, y) of an actor as the ego of `NOW` sees it; None where it is not kept."""
    rows = slice(drive.first[moment], drive.first[moment + 1])
    row = np.flatnonzero(drive.actor_id[rows] == actor)
    if not len(row):
        return None
    x, y, yaw = drive.poses()[NOW]
    dx, dy = (drive.actors[name][rows][row[0]] - at for name, at in (("x", x), ("y", y)))
    return np.cos(yaw) * dx + np.sin(yaw) * dy, np.cos(yaw) * dy - np.sin(yaw) * dx


def test_others_will_be_where_the_drive_has_them(drive, stage):
    actor = int(drive.actor_id[drive.first[NOW] + 1])
    objects = np.zeros((2, 9))
    objects[0, :2], objects[0, 8] = places(drive, NOW, actor), 1.0
    found = later_places(drive, NOW, stage.view, objects, STEPS)
    for step in range(STEPS):
        there = places(drive, NOW + 1 + step, actor)
        assert found[0, step, 2] == (there is not None)
        assert there is None or found[0, step, :2] == pytest.approx(there, abs=1e-3)
    assert not found[1].any()


def test_where_the_drive_ends_nothing_is_known(drive, stage):
    objects = np.zeros((1, 9))
    last = len(drive) - 1
    later = DriveStage(stage.view.town, stage.view.plans[0], drive.capacity)
    later.set(drive, last)
    objects[0, 8] = 1.0
    assert not later_places(drive, last, later.view, objects, STEPS)[..., 2].any()


def test_what_comes_is_drawn_where_it_will_be(drive, stage):
    rasters = later_rasters(drive, NOW, stage.view, np.zeros((50, 4)), STEPS)
    assert rasters.shape == (STEPS, len(RasterChannel), GRID.cells, GRID.cells)
    # the road does not move, as the ego is left where it is
    assert (rasters[0, RasterChannel.ROAD] > 0).sum() > 100
    others = (RasterChannel.VEHICLE, RasterChannel.WALKER)
    free = ~(rasters[:, others] > 0).any(axis=(0, 1))
    still = rasters[:, RasterChannel.ROAD][:, free]
    assert (still == still[0]).all()
