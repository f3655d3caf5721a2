"""Moments at which the way ahead asks for more than to follow it are drawn more often."""

from __future__ import annotations

import numpy as np
import pytest

from agents.training.caching import MOMENT
from agents.training.interest import INTEREST, draw_weights, reasons
from di_envs.town.lanes import LightState
from di_envs.world.kinds import ActorKind

RED, GREEN = float(LightState.RED), float(LightState.GREEN)


def a_moment(*, speed_mps=8.0, **rows):
    """On a straight road ahead, at a speed, with rows of the prompt's components."""
    moment = np.zeros(1, MOMENT)
    moment["speed"] = speed_mps
    points = moment["routing"].shape[1]
    moment["routing"][0] = [[1.0 + n, 0.0, 0.0, 1.0] for n in range(points)]
    for name, row in rows.items():
        moment[name][0, 0] = row
    return moment


def somebody(kind, x, y, vx=0.0, vy=0.0):
    return (x, y, 0.0, 1.0, 1.0, vx, vy, float(kind), 1.0)


@pytest.mark.parametrize(
    ("moment", "found"),
    [
        ({}, set()),
        ({"obstacles": somebody(ActorKind.WALKER, 12, 4)}, {"people"}),
        ({"obstacles": somebody(ActorKind.BICYCLE, 12, -4)}, {"people"}),
        ({"obstacles": somebody(ActorKind.WALKER, 12, 9)}, set()),
        ({"obstacles": somebody(ActorKind.WALKER, -5, 0)}, set()),
        ({"obstacles": somebody(ActorKind.CAR, 12, 4)}, set()),
        ({"obstacles": somebody(ActorKind.CAR, 20, 10, vy=-6)}, {"crossing"}),
        ({"obstacles": somebody(ActorKind.CAR, 20, 0, vx=9)}, set()),
        ({"traffic_lights": (25, 0, 0, RED, 1)}, {"light"}),
        ({"traffic_lights": (3, 0, 0, RED, 1), "speed_mps": 0.0}, {"light"}),
        ({"traffic_lights": (25, 0, 0, GREEN, 1)}, set()),
        ({"traffic_lights": (8, 0, 0, GREEN, 1), "speed_mps": 0.0}, {"green"}),
        ({"traffic_lights": (25, -3.5, 0, RED, 1)}, set()),
        ({"traffic_lights": (25, 0, np.pi, RED, 1)}, set()),
        ({"stop_signs": (8, 0, 0, 1)}, {"sign"}),
        ({"stop_signs": (18, 0, 0, 1)}, set()),
    ],
)
def test_what_there_is_near_the_way_is_a_reason(moment, found):
    row = a_moment(**moment)
    assert {name for name, there in reasons(row).items() if there[0]} == found
    more = sum(INTEREST[name] for name in found)
    assert draw_weights(row, INTEREST) == pytest.approx([1.0 + more])
    assert draw_weights(row, {}) == pytest.approx([1.0])


def test_where_the_way_bends_reasons_bend_with_it():
    """Who is to the right of the ego is on a way that turns right, and beside a straight one."""
    straight, bent = (a_moment(obstacles=somebody(ActorKind.WALKER, 9, 9)) for _ in range(2))
    points = bent["routing"].shape[1]
    turn = (1.0 + np.arange(points)) / 10.0  # of a circle of 10 m, a metre a point
    bent["routing"][0] = np.stack(
        [10 * np.sin(turn), 10 - 10 * np.cos(turn), turn, np.ones(points)], axis=1
    )
    assert not reasons(straight)["people"][0]
    assert reasons(bent)["people"][0]


def test_a_vehicle_in_the_lane_that_the_way_changes_to_is_a_reason():
    beside = a_moment(obstacles=somebody(ActorKind.CAR, 2, 3.5))
    assert not reasons(beside)["merging"][0]
    beside["routing"][0, 3:, 1] = 3.5  # from three metres ahead on in its lane
    assert reasons(beside)["merging"][0]
    far = a_moment(obstacles=somebody(ActorKind.CAR, 20, 3.5))
    far["routing"] = beside["routing"]
    assert not reasons(far)["merging"][0]


def test_what_the_expert_then_does_is_no_reason():
    row = a_moment(stop_signs=(8, 0, 0, 1))
    braked = row.copy()
    braked["waypoints"], braked["valid"] = 3.0, 1
    assert draw_weights(row, INTEREST) == draw_weights(braked, INTEREST)
