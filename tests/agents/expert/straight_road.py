"""A straight path and a scene on it, so that the expert's rules can be checked by arithmetic.

The path runs east from x = 0 along y = 0 (y south, so positive offsets are to the right). The ego,
actor 0, drives on it by the real decision kernel and the real longitudinal model.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from agents.expert.surroundings import Actors, Lights, Ways

from agents.expert.base_line import STEP_M
from agents.expert.config import ExpertConfig
from agents.expert.decision import decide, start_progress
from agents.expert.path import DrivePath
from agents.expert.progress import Progress
from di_envs.town.lanes import LightState, SignalKind
from di_envs.world.dynamics import EgoModel, longitudinal_acceleration
from di_envs.world.state import PATH_LANES, ActorKind

LENGTH_M = 400.0
LIMIT_MPS = 14.0
CONFIG = ExpertConfig()
MODEL = EgoModel()
HALF_M = MODEL.half_length_m


def make_path(
    *,
    line_m: float | None = None,
    kind: SignalKind = SignalKind.LIGHT,
    junction: tuple[float, float] | None = None,
    change: tuple[float, float, float, float] | None = None,
    limit_mps: float = LIMIT_MPS,
) -> DrivePath:
    """A straight path.

    Args:
        line_m: Station of a stop line.
        kind: What governs it.
        junction: Stations between which a junction lies (lane 1; lanes 0 and 2 before and behind).
        change: A lane change's jump, latest begin, limit and shift [m]; before the jump the path
            runs on the old lane, at y = shift.
    """
    count = int(LENGTH_M / STEP_M)
    station = np.arange(count) * STEP_M
    lines = [] if line_m is None else [line_m]
    begins = [0.0, *(junction or ())]
    ends = [*(junction or ()), LENGTH_M]
    jump, latest, limit, shift = ([value] for value in change) if change else ([], [], [], [])
    return DrivePath(
        x=station,
        y=np.where(station < change[0], change[3], 0.0) if change else np.zeros(count),
        z=np.zeros(count),
        yaw=np.zeros(count),
        curvature=np.zeros(count),
        speed_mps=np.full(count, limit_mps),
        leg_lane=np.arange(len(begins), dtype=np.int32),
        leg_junction=np.array([-1, 0, -1][: len(begins)], np.int32),
        leg_begin_m=np.array(begins),
        leg_end_m=np.array(ends),
        leg_offset_m=np.array(begins),
        change_jump_m=np.array(jump, np.float64),
        change_latest_m=np.array(latest, np.float64),
        change_limit_m=np.array(limit, np.float64),
        change_shift_m=np.array(shift, np.float64),
        line_m=np.array(lines, np.float64),
        line_signal=np.zeros(len(lines), np.int32),
        line_kind=np.full(len(lines), kind, np.int8),
        end_m=np.array([LENGTH_M]),
    )


def make_ways(crossing: tuple[float, float] | None = None) -> Ways:
    """Lanes 0, 1, 2 of the path and lane 3, which crosses lane 1 of the junction.

    Args:
        crossing: Stations on lane 1 between which lane 3 meets it, at its own stations 5 to 9 m.
    """
    meets = [] if crossing is None else [crossing]
    return Ways(
        junction=np.array([-1, 0, -1, 0], np.int32),
        length_m=np.array([100.0, 20.0, 280.0, 20.0]),
        predecessor_start=np.zeros(5, np.int32),
        predecessor=np.zeros(0, np.int32),
        conflict_start=np.array([0, 0, len(meets), len(meets), len(meets)], np.int32),
        conflict_lane=np.full(len(meets), 3, np.int32),
        conflict_begin_m=np.array([m[0] for m in meets], np.float64),
        conflict_end_m=np.array([m[1] for m in meets], np.float64),
        conflict_other_begin_m=np.full(len(meets), 5.0),
        conflict_other_end_m=np.full(len(meets), 9.0),
    )


def make_actors(others: int = 0) -> Actors:
    """The ego at the path's start, and cars that are far away until they are put somewhere."""
    count = 1 + others
    return Actors(
        kind=np.full(count, ActorKind.CAR, np.int8),
        x=np.array([0.0] + [-1e4] * others),
        y=np.zeros(count),
        z=np.zeros(count),
        yaw=np.zeros(count),
        speed=np.zeros(count),
        half_length=np.array([HALF_M] + [2.4] * others),
        half_width=np.array([MODEL.half_width_m] + [1.0] * others),
        lane=np.full(count, -1, np.int32),
        lane_m=np.zeros(count),
        lateral_m=np.zeros(count),
        path=np.full((count, PATH_LANES), -1, np.int32),
        previous_lane=np.full(count, -1, np.int32),
        changing_from=np.full(count, -1, np.int32),
        grant=np.full(count, -1, np.int32),
        walk_edge=np.full(count, -1, np.int32),
    )


def make_lights(state: LightState = LightState.GREEN, ticks: int = 0) -> Lights:
    """One light, its turn begun `ticks` ago."""
    return Lights(np.array([state], np.int8), np.zeros(1, np.int32), np.array([ticks], np.int32))


def read_only(array: np.ndarray) -> np.ndarray:
    """The same array as the world hands it out, so that it is the same machine code that runs."""
    view = array.view()
    view.flags.writeable = False
    return view


def frozen(arrays: Any) -> Any:
    """The same named tuple of arrays that cannot be written."""
    return type(arrays)(*map(read_only, arrays))


class Drive:
    """The ego on the path, a decision of 0.1 s at a time."""

    def __init__(
        self,
        path: DrivePath,
        actors: Actors,
        *,
        ways: Ways | None = None,
        lights: Lights | None = None,
        config: ExpertConfig = CONFIG,
    ) -> None:
        self.path, self.actors = path, actors
        self.ways = ways or make_ways()
        self.lights = lights or make_lights()
        self.numbers, self.model = config.numbers(), MODEL.parameters()
        self.progress: Progress = start_progress()
        self.control = (0.0, 0.0, 0.0)

    @property
    def x(self) -> float:
        return float(self.actors.x[0])

    @property
    def front(self) -> float:
        return self.x + HALF_M

    @property
    def speed(self) -> float:
        return float(self.actors.speed[0])

    def place(self, x: float, speed: float) -> None:
        """Puts the ego on the path."""
        self.actors.x[0], self.actors.speed[0] = x, speed
        self.progress = Progress(x, *self.progress[1:])

    def step(self, dt_s: float = 0.1) -> None:
        """Decides and moves everybody straight on; the ego keeps to its path by itself."""
        throttle, steer, brake, self.progress = decide(
            frozen(self.path),
            self.progress,
            frozen(self.actors),
            frozen(self.ways),
            frozen(self.lights),
            0,
            self.numbers,
            self.model,
        )
        self.control = (throttle, steer, brake)
        push = longitudinal_acceleration(self.speed, throttle, brake, self.model)
        after = max(self.speed + push * dt_s, 0.0)
        moved = 0.5 * (self.speed + after) * dt_s
        self.actors.speed[0] = after
        others = slice(1, None)
        speed, yaw = self.actors.speed[others], self.actors.yaw[others]
        self.actors.x[others] += speed * np.cos(yaw) * dt_s
        self.actors.y[others] += speed * np.sin(yaw) * dt_s
        self.actors.lane_m[others] += speed * dt_s
        self.actors.x[0] += moved

    def run(self, seconds: float) -> None:
        """Drives on for a while."""
        for _ in range(round(seconds / 0.1)):
            self.step()
