"""The rules of Leaderboard 1.0 are the published numbers, and names are checked."""

from __future__ import annotations

import pytest

from di_envs.config import RULES as ENVIRONMENT_RULES
from di_envs.world.state import EventKind
from leaderboard.rules import CARLA_1_0, RULES, Rules, rules_named


def test_carla_1_0_has_the_published_penalties():
    assert dict(CARLA_1_0.factors) == {
        EventKind.COLLISION_WALKER: 0.5,
        EventKind.COLLISION_VEHICLE: 0.6,
        EventKind.COLLISION_STATIC: 0.65,
        EventKind.RED_LIGHT: 0.7,
        EventKind.STOP_SIGN: 0.8,
    }


def test_what_ends_a_route_costs_nothing_but_the_rest_of_the_route():
    ends = {EventKind.ROUTE_DEVIATION, EventKind.BLOCKED, EventKind.TIMEOUT, EventKind.COMPLETED}
    assert ends == set(CARLA_1_0.endings)
    assert not ends & (CARLA_1_0.factors.keys() | CARLA_1_0.proportional)


def test_a_typo_in_the_rules_name_is_answered_with_the_right_one():
    with pytest.raises(ValueError, match=r"unknown rules 'carla-1\.O'; did you mean 'carla-1\.0'"):
        rules_named("carla-1.O")


def test_the_environment_knows_the_same_rules_as_the_leaderboard():
    assert set(ENVIRONMENT_RULES) == set(RULES)


@pytest.mark.parametrize("factor", [0.0, -0.5, 1.5])
def test_a_factor_that_could_raise_a_score_or_void_it_is_refused(factor):
    with pytest.raises(ValueError, match="RED_LIGHT must be in"):
        Rules(
            name="wrong",
            factors={EventKind.RED_LIGHT: factor},
            proportional=frozenset(),
            endings={},
        )


def test_rules_cannot_be_changed_by_accident():
    with pytest.raises(TypeError):
        CARLA_1_0.factors[EventKind.RED_LIGHT] = 1.0  # type: ignore[index]
