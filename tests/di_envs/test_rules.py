"""The rules are the published numbers, and names are checked."""

from __future__ import annotations

from pathlib import Path

import pytest

import di_envs.rules as rules_package
from di_envs.config import RouteEnvConfig
from di_envs.rules import (
    CARLA_1_0,
    CARLA_2_0,
    CARLA_2_1,
    DI_1_0,
    RULES,
    Rules,
    rules_named,
)
from di_envs.rules.penalties import Form, Penalties
from di_envs.rules.rule_set import Layout
from di_envs.world.kinds import EventKind

FACTORS = {
    EventKind.COLLISION_WALKER: 0.5,
    EventKind.COLLISION_VEHICLE: 0.6,
    EventKind.COLLISION_STATIC: 0.65,
    EventKind.RED_LIGHT: 0.7,
    EventKind.STOP_SIGN: 0.8,
}


def test_carla_1_0_and_2_0_have_the_published_factors():
    for rules in (CARLA_1_0, CARLA_2_0):
        assert rules.penalties.form == Form.PRODUCT
        assert dict(rules.penalties.costs) == FACTORS
    assert (CARLA_1_0.penalties.min_speed, CARLA_2_0.penalties.min_speed) == (0.0, 0.3)


def test_carla_2_1_adds_up_the_published_costs():
    assert CARLA_2_1.penalties.form == Form.SUM
    assert dict(CARLA_2_1.penalties.costs) == {
        EventKind.COLLISION_WALKER: 1.0,
        EventKind.COLLISION_VEHICLE: 0.7,
        EventKind.COLLISION_STATIC: 0.6,
        EventKind.RED_LIGHT: 0.4,
        EventKind.STOP_SIGN: 0.25,
    }
    assert CARLA_2_1.penalties.min_speed == 0.4


def test_di_1_0_has_the_factors_of_1_0_for_what_it_sees_instead():
    assert dict(DI_1_0.penalties.costs) == {
        EventKind.FIRST_HIT_WALKER: 0.5,
        EventKind.FIRST_HIT_VEHICLE: 0.6,
        EventKind.FIRST_HIT_STATIC: 0.65,
        EventKind.RED_LIGHT_WIDE: 0.7,
        EventKind.STOP_SIGN: 0.8,
    }
    assert len(DI_1_0.infractions) == len(CARLA_1_0.infractions)


def test_every_rule_set_says_something_of_every_event():
    for rules in RULES.values():
        for kind in EventKind:
            rules.check(kind)


def test_an_event_that_the_rules_do_not_know_is_refused():
    narrow = Rules(
        name="narrow", penalties=CARLA_1_0.penalties, layout=Layout.V1, ignored=frozenset()
    )
    with pytest.raises(ValueError, match="rules narrow do not say what the event scenario costs"):
        narrow.check(EventKind.SCENARIO)
    with pytest.raises(ValueError, match="event 99"):
        narrow.check(99)  # type: ignore[arg-type]


def test_what_ends_a_route_costs_nothing_but_the_rest_of_the_route():
    ends = {EventKind.ROUTE_DEVIATION, EventKind.BLOCKED, EventKind.TIMEOUT, EventKind.COMPLETED}
    for rules in RULES.values():
        assert ends == set(rules.endings)
        assert not ends & set(rules.scored)


def test_an_event_cannot_be_ignored_and_count():
    with pytest.raises(ValueError, match="RED_LIGHT cannot be ignored"):
        Rules(
            name="wrong",
            penalties=CARLA_1_0.penalties,
            layout=Layout.V1,
            ignored=frozenset({EventKind.RED_LIGHT}),
        )


@pytest.mark.parametrize(
    ("kinds", "one", "two"),
    [
        ([EventKind.COMPLETED], "Completed", "Perfect"),
        ([EventKind.RED_LIGHT, EventKind.COMPLETED], "Completed", "Completed"),
        ([EventKind.MIN_SPEED, EventKind.COMPLETED], "Completed", "Completed"),
        ([EventKind.SCENARIO, EventKind.COMPLETED], "Completed", "Perfect"),
        ([EventKind.TIMEOUT], "Failed - Agent timed out", "Failed - Agent timed out"),
        ([EventKind.COLLISION_VEHICLE], "Failed", "Failed"),  # `terminate_on`
    ],
)
def test_a_routes_status_is_carlas(kinds, one, two):
    assert CARLA_1_0.status(kinds) == one
    assert CARLA_2_0.status(kinds) == CARLA_2_1.status(kinds) == two


def test_a_typo_in_the_rules_name_is_answered_with_the_right_one():
    with pytest.raises(ValueError, match=r"unknown rules 'carla-1\.O'; did you mean 'carla-1\.0'"):
        rules_named("carla-1.O")


def test_the_environment_takes_every_rule_set_by_name_and_answers_a_typo():
    for name in RULES:
        assert RouteEnvConfig(suite="town05_tiny", rules=name).rules == name
    with pytest.raises(ValueError, match=r"did you mean 'carla-2\.1'\? known: .*carla-1\.0"):
        RouteEnvConfig(suite="town05_tiny", rules="carla-2.l")


def test_each_rule_set_has_a_file_of_its_own():
    files = {path.stem for path in Path(rules_package.__file__).parent.glob("*_[0-9]_[0-9].py")}
    assert files == {name.replace("-", "_").replace(".", "_") for name in RULES}


@pytest.mark.parametrize(
    ("form", "cost"), [("product", 0.0), ("product", -0.5), ("product", 1.5), ("sum", 0.0)]
)
def test_a_cost_that_could_raise_a_score_or_void_it_is_refused(form, cost):
    with pytest.raises(ValueError, match="RED_LIGHT must be"):
        Penalties(form=Form(form), costs={EventKind.RED_LIGHT: cost})


def test_rules_cannot_be_changed_by_accident():
    with pytest.raises(TypeError):
        CARLA_1_0.penalties.costs[EventKind.RED_LIGHT] = 1.0  # type: ignore[index]
