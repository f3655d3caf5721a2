"""What a replay of a route shows, moment by moment, as columns that a page can hold.

A film has a moment every tenth of a second (or a decision, where those are rarer): the ego, who is
near it, the lights. Each stay of an actor near the ego is a track; the numbers of all tracks follow
each other in columns of their own. `docs/report.md` lists the columns.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.drawing.outlines import BRIDGE_M
from di_envs.town.plan import RoutePlan
from di_envs.world.kinds import ActorKind
from di_envs.world.struck import DOWN
from leaderboard.records.blocks import Column
from leaderboard.replaying.replay import ReplayStep

MOMENT_S = 0.1  # between two moments, at least
NEAR_M = 80.0  # who is nearer to the ego than that is shown
METRE_STEP, ANGLE_STEP, SHARE_STEP, SPEED_STEP = 0.01, 0.001, 0.001, 0.01
PERCENT_STEP = 0.01

# Bits of an actor's flags
ABOVE, BRAKES, LEFT, RIGHT, LIES = 1, 2, 4, 8, 16

_EGO = ("x", "y", "yaw", "speed")
# The columns with a number a moment, in the order of `Film.add`, and their steps
_ROW_STEPS = {
    "tick": 1.0,
    "ego_x": METRE_STEP,
    "ego_y": METRE_STEP,
    "ego_yaw": ANGLE_STEP,
    "ego_speed": SPEED_STEP,
    "ego_flags": 1.0,
    "throttle": SHARE_STEP,
    "steer": SHARE_STEP,
    "brake": SHARE_STEP,
    "score": PERCENT_STEP,
    "completion": PERCENT_STEP,
    "route_index": 1.0,
    "target": 1.0,
}


class Film:
    """Takes up the moments of one route as they are replayed."""

    def __init__(self) -> None:
        self._rows: list[tuple[float, ...]] = []
        self._near: list[NDArray[np.float64]] = []
        self._lights: list[tuple[int, int, int]] = []
        self._shown: NDArray[np.int8] | None = None
        self._bodies: dict[int, tuple[float, float]] = {}
        self._plan: RoutePlan | None = None

    @property
    def moments(self) -> int:
        """How many there are so far."""
        return len(self._rows)

    def add(self, step: ReplayStep) -> None:
        """Adds what a step of the replay shows."""
        view, state, ego = step.view, step.view.state, step.view.ego
        self._plan = view.plans[ego]
        control = (0.0, 0.0, 0.0) if step.control is None else step.control.tolist()
        self._rows.append(
            (
                float(state.tick),
                *(float(getattr(state, name)[ego]) for name in _EGO),
                float(_flags(state, np.array([ego]))[0]),
                *control,
                float(step.info["driving_score"]),
                float(step.info["route_completion"]),
                float(state.route_index[ego]),
                float(self._plan.targets[state.target_index[ego]]),
            )
        )
        self._add_actors(state, ego)
        self._add_lights(state)

    def _add_actors(self, state: Any, ego: int) -> None:
        there = np.hypot(state.x - state.x[ego], state.y - state.y[ego]) < NEAR_M
        there &= (state.kind != ActorKind.ABSENT) & (state.kind != ActorKind.PROP)
        there[ego] = False
        who = np.flatnonzero(there)
        moment = np.full(who.size, len(self._rows) - 1)
        values = (state.kind[who], state.x[who], state.y[who], state.yaw[who], _flags(state, who))
        self._near.append(np.stack([who, moment, *values], axis=1))
        for actor in who.tolist():
            if actor not in self._bodies:
                size = state.half_length[actor], state.half_width[actor]
                self._bodies[actor] = (float(size[0]), float(size[1]))

    def _add_lights(self, state: Any) -> None:
        """Every light at first, then those that have changed."""
        shows = state.light.copy()
        changed = shows > 0 if self._shown is None else shows != self._shown
        moment = len(self._rows) - 1
        self._lights += [(moment, int(i), int(shows[i])) for i in np.flatnonzero(changed)]
        self._shown = shows

    def columns(self) -> dict[str, Column]:
        """All that was taken up.

        Raises:
            ValueError: If it is nothing.
        """
        if self._plan is None:
            raise ValueError("a film needs at least one moment")
        rows = np.array(self._rows)
        rows[:, 3] = np.unwrap(rows[:, 3])
        columns = {
            name: Column(values=rows[:, index], step=step)
            for index, (name, step) in enumerate(_ROW_STEPS.items())
        }
        lights = np.array(self._lights, np.float64).reshape(-1, 3)
        for index, name in enumerate(("light_moment", "light", "light_state")):
            columns[name] = Column(values=lights[:, index])
        return columns | self._tracks() | route_columns(self._plan)

    def _tracks(self) -> dict[str, Column]:
        """Each stay of an actor: who it is, when it begins and how many moments it lasts."""
        rows = np.concatenate(self._near)
        rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
        actor, moment, kind = rows[:, 0], rows[:, 1], rows[:, 2]
        begins = np.ones(len(rows), bool)
        begins[1:] = (np.diff(actor) != 0) | (np.diff(moment) != 1) | (np.diff(kind) != 0)
        first = np.flatnonzero(begins)
        bodies = np.array([self._bodies[int(who)] for who in actor[first]]).reshape(-1, 2)
        return {
            "track_actor": Column(values=actor[first]),
            "track_kind": Column(values=kind[first]),
            "track_moment": Column(values=moment[first]),
            "track_count": Column(values=np.diff(np.append(first, len(rows)))),
            "track_half_length": Column(values=bodies[:, 0], step=METRE_STEP),
            "track_half_width": Column(values=bodies[:, 1], step=METRE_STEP),
            "actor_x": Column(values=rows[:, 3], step=METRE_STEP),
            "actor_y": Column(values=rows[:, 4], step=METRE_STEP),
            "actor_yaw": Column(values=np.unwrap(rows[:, 5]), step=ANGLE_STEP),
            "actor_flags": Column(values=rows[:, 6]),
        }


def route_columns(plan: RoutePlan) -> dict[str, Column]:
    """The route's points, which of them are on a bridge, and which are target points."""
    return {
        "route_x": Column(values=plan.points[:, 0], step=METRE_STEP),
        "route_y": Column(values=plan.points[:, 1], step=METRE_STEP),
        "route_flags": Column(values=np.where(plan.points[:, 2] > BRIDGE_M, ABOVE, 0)),
        "targets": Column(values=plan.targets),
    }


def film_every(control_dt_s: float) -> int:
    """How many decisions lie between two moments."""
    return max(1, round(MOMENT_S / control_dt_s))


def film_of(steps: Iterable[ReplayStep], control_dt_s: float) -> Film:
    """The film of a whole replay: a moment every `MOMENT_S` at least, and the last one."""
    every = film_every(control_dt_s)
    film = Film()
    last_tick = -1
    step = None
    for step in steps:
        if step.decision % every == 0 or step.over:
            film.add(step)
            last_tick = int(step.view.state.tick)
    if step is not None and int(step.view.state.tick) != last_tick:
        film.add(step)
    return film


def _flags(state: Any, who: NDArray[np.int64]) -> NDArray[np.int64]:
    flags = np.where(state.z[who] > BRIDGE_M, ABOVE, 0)
    flags += np.where(state.brake_light[who] != 0, BRAKES, 0)
    flags += np.where(state.indicator[who] < 0, LEFT, 0)
    flags += np.where(state.indicator[who] > 0, RIGHT, 0)
    return flags + np.where(state.walk_waiting[who] == DOWN, LIES, 0)
