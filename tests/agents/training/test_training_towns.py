"""Training towns: there for everybody alike, drivable, and none of them is Town05."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache

import numpy as np
import pytest

from agents.training.towns import TRAINING_TOWNS, load_training_town, town_files
from di_envs.numerics.kernels import kernel_cache
from di_envs.town.lanes import SignalKind
from di_envs.town.loading import load_town

loaded = cache(load_training_town)  # a second each


@pytest.mark.parametrize("name", TRAINING_TOWNS)
def test_each_town_has_junctions_with_lights_and_signs_routes_and_triggers(name):
    town, plans = loaded(name)
    kinds = set(town.signals.kind.tolist())
    assert {int(SignalKind.LIGHT), int(SignalKind.STOP)} <= kinds
    assert len(set(town.lanes.junction[town.lanes.junction >= 0].tolist())) >= 4
    assert len(plans) >= 50
    assert all(200.0 < plan.route_m[-1] < 900.0 for plan in plans)
    assert sum(len(plan.scenarios) for plan in plans) > len(plans)


def test_no_lane_of_a_training_town_lies_where_one_of_town05_does():
    theirs = load_town("town05").lanes
    for name in TRAINING_TOWNS:
        ours = loaded(name)[0].lanes
        apart_m = np.linalg.norm(ends_of(ours)[:, None] - ends_of(theirs)[None], axis=2).max(axis=2)
        assert apart_m.min() > 1.0, name


def ends_of(lanes):
    """(L, 2, 2) x, y of each lane's first and last point."""
    first, last = lanes.first, lanes.first + lanes.count - 1
    return np.stack([lanes.points[first, :2], lanes.points[last, :2]], axis=1)


def test_another_process_with_an_empty_cache_makes_the_same_files(tmp_path):
    (tmp_path / "driveinsight").mkdir()
    (tmp_path / "driveinsight" / "kernels").symlink_to(kernel_cache())  # empty but for these
    code = "from agents.training.towns import town_files; print(town_files('small_grid').folder)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "XDG_CACHE_HOME": str(tmp_path), "PYTHONHASHSEED": "7"},
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    here, there = town_files("small_grid").folder, done.stdout.strip()
    assert there.startswith(str(tmp_path))
    for path in sorted(here.iterdir()):
        assert path.read_bytes() == (tmp_path / there / path.name).read_bytes(), path.name


def test_an_unknown_town_is_suggested():
    with pytest.raises(ValueError, match="did you mean 'suburb'"):
        town_files("suburbs")
