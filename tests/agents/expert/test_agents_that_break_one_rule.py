"""Agents that break one rule pay for exactly that, counted a second way, under all rule sets.

Who crossed which line under which light, who stood before it, and whose bodies met is counted here
from the world's states alone; the geometry of the rules' own kernels is not asked.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

from agents import load_agent
from di_envs import RouteEnv
from di_envs.rules import RULES
from di_envs.town.lanes import LightState, SignalKind
from di_envs.world.state import ActorKind, EventKind
from leaderboard.records.record import RouteRecord
from leaderboard.records.rescoring import rescored_route
from leaderboard.running.episode import drive_route
from leaderboard.running.jobs import Job

TICK_S = 0.05
STANDING_MPS = 0.1
LEFT_M = 0.0015  # between bodies that were pushed apart
SIGN_REACH_M = 20.0 + 4.0  # the rule looks 20 m ahead, for the 4 m box before the line
RED, STOP = EventKind.RED_LIGHT, EventKind.STOP_SIGN
WIDE, FIRST_HIT = EventKind.RED_LIGHT_WIDE, EventKind.FIRST_HIT_VEHICLE


class LineWatch(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Looks at each tick where the ego is in the frame of every stop line."""

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        result = self.env.reset(**arguments)
        self.reds_run: list[int] = []  # signals, a pass each
        self.lights_passed = 0
        self.signs_passed: dict[bool, list[int]] = {True: [], False: []}  # by: stood before it
        self._tail: dict[int, bool] = {}  # lights below the tail: whether red was seen
        self._stood: set[int] = set()
        self._ahead: NDArray[np.float64] | None = None
        return result

    def step(self, action: Any) -> Any:
        result = self.env.step(action)
        self._look()
        return result

    def _look(self) -> None:
        view = self.unwrapped.view  # type: ignore[attr-defined]
        state, signals = view.state, view.town.signals
        dx, dy = state.x[0] - signals.stop_pose[:, 0], state.y[0] - signals.stop_pose[:, 1]
        cos, sin = np.cos(signals.stop_pose[:, 3]), np.sin(signals.stop_pose[:, 3])
        past, right = dx * cos + dy * sin, dy * cos - dx * sin  # of the ego's centre
        mine = np.abs(right) < signals.stop_width_m / 2.0
        mine &= np.abs(state.z[0] - signals.stop_pose[:, 2]) < 3.0
        along = np.cos(state.yaw[0] - signals.stop_pose[:, 3])
        mine &= along > 0.0
        kind = signals.kind[signals.stop_signal]
        half = float(state.half_length[0])
        tail = mine & (kind == SignalKind.LIGHT)
        tail &= (past >= 0.8 * half * along) & (past <= (half + 1.0) * along)
        self._follow_tail(set(signals.stop_signal[tail].tolist()), state.light)
        sign = mine & (kind == SignalKind.STOP)
        if state.speed[0] < STANDING_MPS:
            near = sign & (past <= 0.0) & (past >= -SIGN_REACH_M)
            self._stood |= set(signals.stop_signal[near].tolist())
        before = past if self._ahead is None else self._ahead
        for signal in signals.stop_signal[sign & (before <= 0.0) & (past > 0.0)].tolist():
            self.signs_passed[signal in self._stood].append(signal)
            self._stood.discard(signal)
        self._ahead = past

    def _follow_tail(self, below: set[int], light: NDArray[np.int8]) -> None:
        for signal in set(self._tail) - below:
            del self._tail[signal]
        for signal in sorted(below):
            seen = self._tail.get(signal)
            self.lights_passed += seen is None
            red = bool(light[signal] == LightState.RED)
            if red and not seen:
                self.reds_run.append(signal)
            self._tail[signal] = red or bool(seen)


class TouchWatch(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Notes at each tick whose body meets the ego's: (tick, actor, x, y of the ego)."""

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        self.touches: list[tuple[int, int, float, float]] = []
        return self.env.reset(**arguments)

    def step(self, action: Any) -> Any:
        result = self.env.step(action)
        state = self.unwrapped.view.state  # type: ignore[attr-defined]
        reach = state.half_length + state.half_width  # at least the way to a corner
        near = np.hypot(state.x - state.x[0], state.y - state.y[0]) < reach + reach[0]
        near &= (state.kind != ActorKind.ABSENT) & (np.abs(state.z - state.z[0]) < 2.0)
        for other in np.flatnonzero(near)[1:]:
            if boxes_meet(state, 0, int(other)):
                place = float(state.x[0]), float(state.y[0])
                self.touches.append((int(state.tick[()]), int(other), *place))
        return result


def boxes_meet(state: Any, one: int, other: int) -> bool:
    """Whether no side of the two boxes has them apart, by more than what a push leaves."""
    corners = [corners_of(state, actor) for actor in (one, other)]
    for actor in (one, other):
        for angle in (state.yaw[actor], state.yaw[actor] + np.pi / 2.0):
            along = [points @ np.array([np.cos(angle), np.sin(angle)]) for points in corners]
            if max(along[0].min() - along[1].max(), along[1].min() - along[0].max()) > LEFT_M:
                return False
    return True


def corners_of(state: Any, actor: int) -> NDArray[np.float64]:
    """(4, 2) corners of an actor's box."""
    ahead = np.array([np.cos(state.yaw[actor]), np.sin(state.yaw[actor])])
    right = np.array([-ahead[1], ahead[0]])
    half_length, half_width = state.half_length[actor], state.half_width[actor]
    sides = [(1, 1), (1, -1), (-1, -1), (-1, 1)]
    rows = [a * half_length * ahead + r * half_width * right for a, r in sides]
    return np.array(rows) + np.array([state.x[actor], state.y[actor]])


def town05_long(**options: Any) -> RouteEnv:
    """Without scenarios; an action a tick, so that no tick goes unseen."""
    return RouteEnv(
        suite="town05_long",
        observations=("inertial",),
        control_dt_s=TICK_S,
        scenarios="none",
        **options,
    )


def drive(env: Any, agent: str, route: str) -> RouteRecord:
    job = Job(index=0, route_id=route, seed=0)
    return drive_route(env, lambda: load_agent(agent), job, RULES["carla-1.0"])


def by_kind(record: RouteRecord) -> Counter[EventKind]:
    return Counter(event.kind for event in record.events)


def assert_scores(record: RouteRecord, *, times: int, factor: float, weight: float) -> None:
    """A completed route that lost a factor, or in 2.1 a weight, so many times."""
    expected = {
        "carla-1.0": factor**times,
        "carla-2.0": factor**times,
        "carla-2.1": 1.0 / (1.0 + weight * times),
        "di-1.0": factor**times,
    }
    for name, penalty in expected.items():
        score = rescored_route(record, RULES[name]).score
        assert score.infraction_score == pytest.approx(penalty, rel=1e-12), name
        assert score.driving_score == pytest.approx(100.0 * penalty, rel=1e-12), name


@pytest.fixture(scope="module")
def quiet() -> LineWatch:
    return LineWatch(town05_long(traffic=0, walkers=0))


ROUTES = ("0", "5", "9")


def test_who_ignores_lights_pays_for_each_red_that_its_tail_crosses_and_for_nothing_else(
    quiet: LineWatch,
) -> None:
    total = passed = 0
    for route in ROUTES:
        record = drive(quiet, "expert-redrunner", route)
        assert [e.other for e in record.events if e.kind == RED] == quiet.reds_run
        reds = len(quiet.reds_run)
        assert by_kind(record) == {RED: reds, WIDE: reds, EventKind.COMPLETED: 1}
        assert quiet.signs_passed[False] == []
        assert_scores(record, times=reds, factor=0.7, weight=0.4)
        total, passed = total + reds, passed + quiet.lights_passed
    assert 10 <= total < passed  # some were green


def test_who_ignores_stop_signs_pays_for_each_that_it_passes_and_for_nothing_else(
    quiet: LineWatch,
) -> None:
    total = 0
    for route in ROUTES:
        record = drive(quiet, "expert-signrunner", route)
        assert [e.other for e in record.events if e.kind == STOP] == quiet.signs_passed[False]
        signs = len(quiet.signs_passed[False])
        assert by_kind(record) == {STOP: signs, EventKind.COMPLETED: 1}
        assert quiet.reds_run == []
        assert_scores(record, times=signs, factor=0.8, weight=0.25)
        total += signs
    assert total >= 10


def test_the_expert_passes_the_same_lines_and_pays_nothing(quiet: LineWatch) -> None:
    record = drive(quiet, "expert", "0")
    assert by_kind(record) == {EventKind.COMPLETED: 1}
    assert quiet.lights_passed >= 10
    assert len(quiet.signs_passed[True]) >= 5
    assert quiet.reds_run == quiet.signs_passed[False] == []
    assert_scores(record, times=0, factor=0.7, weight=0.4)


def test_who_ignores_others_pays_for_those_it_touches_and_the_expert_touches_nobody() -> None:
    watch = TouchWatch(town05_long())
    record = drive(watch, "expert-blind", "7")
    hits = [event for event in record.events if event.kind == EventKind.COLLISION_VEHICLE]
    places = {touch[:2]: touch[2:] for touch in watch.touches}
    assert {(event.tick, event.other) for event in hits} <= places.keys()
    for tick, other, x, y in watch.touches:  # what is not fined is remembered, or is a tick later
        assert any(
            (hit.other == other and -1 <= tick - hit.tick <= 5.0 / TICK_S)
            or any(other == who and 0 < tick - when <= 1.0 / TICK_S for when, who in places)
            or (hit.tick < tick and math.dist((x, y), places[hit.tick, hit.other]) <= 5.0)
            for hit in hits
        )
    slow = [e.value / 100.0 for e in record.events if e.kind == EventKind.MIN_SPEED]
    bodies = len({other for _, other, _, _ in watch.touches})
    kinds = {EventKind.COLLISION_VEHICLE: len(hits), FIRST_HIT: bodies, EventKind.COMPLETED: 1}
    assert by_kind(record) == kinds | {EventKind.MIN_SPEED: len(slow)}
    assert len(hits) >= 3
    # 2.x fines slowness too: by up to 0.3 of the score, or 0.4 of the sum
    expected = {
        "carla-1.0": 0.6 ** len(hits),
        "carla-2.0": 0.6 ** len(hits) * math.prod(1.0 - 0.3 * (1.0 - p) for p in slow),
        "carla-2.1": 1.0 / (1.0 + 0.7 * len(hits) + sum(0.4 * (1.0 - p) for p in slow)),
        "di-1.0": 0.6**bodies,
    }
    for name, penalty in expected.items():
        score = rescored_route(record, RULES[name]).score
        assert score.driving_score == pytest.approx(100.0 * penalty, rel=1e-12), name
    assert EventKind.COLLISION_VEHICLE not in by_kind(drive(watch, "expert", "7"))
    assert watch.touches == []
