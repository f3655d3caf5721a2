"""Training towns: there for everybody alike, drivable, and none of them is Town05."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from agents.training.town_styles import TRAINING_TOWNS
from agents.training.towns import (
    KNOWN_TOWNS,
    SHIPPED_TOWNS,
    block_of,
    town_files,
    training_plan,
    training_plans,
    training_town,
)
from di_envs.numerics.kernels import kernel_cache
from di_envs.route_env import RouteEnv
from di_envs.suites import load_suite
from di_envs.town.lanes import SignalKind
from di_envs.town.loading import load_town
from di_envs.town.plan import RoadOption

CHANGES = (RoadOption.CHANGELANELEFT, RoadOption.CHANGELANERIGHT)
MADE_TOWNS = [name for name in KNOWN_TOWNS if name not in SHIPPED_TOWNS]


@pytest.mark.parametrize("name", MADE_TOWNS)
def test_each_town_has_junctions_with_lights_and_signs_routes_and_triggers(name):
    town, plans = training_town(name), training_plans(name)
    kinds = set(town.signals.kind.tolist())
    assert {int(SignalKind.LIGHT), int(SignalKind.STOP)} <= kinds
    assert len(set(town.lanes.junction[town.lanes.junction >= 0].tolist())) >= 4
    assert len(plans) >= 50
    assert all(200.0 < plan.route_m[-1] < 900.0 for plan in plans)
    assert sum(len(plan.scenarios) for plan in plans) > len(plans)


def test_no_lane_of_a_training_town_lies_where_one_of_town05_does():
    theirs = load_town("town05").lanes
    for name in MADE_TOWNS:
        ours = training_town(name).lanes
        apart_m = np.linalg.norm(ends_of(ours)[:, None] - ends_of(theirs)[None], axis=2).max(axis=2)
        assert apart_m.min() > 1.0, name


def test_one_town_leads_over_viaducts_and_no_other_leaves_the_plane():
    for name in TRAINING_TOWNS:
        assert not training_town(name).lanes.points[:, 2].any(), name
    town = training_town("viaducts")
    heights = town.lanes.points[:, 2]
    assert heights.max() == pytest.approx(5.0)
    assert 0.2 < (heights > 2.0).mean() < 0.5
    inside = town.lanes.junction[town.lanes.point_lane] >= 0
    assert not heights[inside].any()  # every viaduct is down before its junction


def test_routes_of_one_town_change_lane_within_the_last_metres_before_a_junction():
    late_m = changes_before_a_junction_m("late_changes")
    near = late_m[late_m < 13.0]
    assert len(near) >= 40
    assert near.min() > 7.0  # those of CARLA's Town05 Long begin 7 to 12 m before it
    for name in TRAINING_TOWNS:
        assert changes_before_a_junction_m(name).min(initial=np.inf) > 25.0, name


def changes_before_a_junction_m(name):
    """How far before its junction's line each lane change of a town's first routes begins [m]."""
    env = RouteEnv(**town_files(name).options(), observations=("prompt",))
    found = []
    for plan in env.plans:
        changes = np.isin(plan.option, CHANGES)
        begins = np.flatnonzero(changes & ~np.append(False, changes[:-1]))
        found.append(env.course.junction_m[plan.route_id][begins])
    return np.concatenate(found)


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


def test_there_is_no_end_to_routes_and_no_two_drives_share_one():
    first, second = (training_plans("small_grid", block) for block in (0, 1))
    assert [plan.route_id for plan in first] == [str(number) for number in range(60)]
    assert [plan.route_id for plan in second] == [str(number) for number in range(60, 120)]
    assert block_of(59) == 0
    assert block_of(60) == 1
    ends = {plan.points[[0, -1], :2].tobytes() for plan in (*first, *second)}
    assert len(ends) == len(first) + len(second)
    assert training_plan("small_grid", "61").points.tobytes() == second[1].points.tobytes()


def test_a_drive_in_town05_begins_and_ends_where_no_suites_route_does():
    theirs = [
        plan.points[[0, -1], :2]
        for name in ("town05_tiny", "town05_short", "town05_long")
        for plan in load_suite(name).plans(load_town("town05"))
    ]
    ours = np.array([plan.points[[0, -1], :2] for plan in training_plans("town05")])
    assert len(ours) > 40
    apart_m = np.linalg.norm(ours[:, None] - np.array(theirs)[None], axis=3)
    assert apart_m.min() > 19.0
    options = town_files("town05").options()
    assert (options["traffic"], options["walkers"]) == (120, 60)  # as in its suites
    assert sum(len(plan.scenarios) for plan in training_plans("town05")) > 40
