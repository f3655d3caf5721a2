"""A straight path and a scene on it, so that the expert's rules can be checked by arithmetic.

The path runs east from x = 0 along y = 0 (y south, so positive offsets are to the right). The ego,
actor 0, drives on it by the real decision kernel and the real longitudinal model.
"""

from __future__ import annotations

import numpy as np

from agents.expert.base_line import STEP_M
from agents.expert.config import ExpertConfig
from agents.expert.crossings import Crossings
from agents.expert.decision import decide, start_progress
from agents.expert.path import DrivePath
from agents.expert.progress import Progress
from agents.expert.visible import Visible, empty_visible
from di_envs.town.lanes import LightState, SignalKind
from di_envs.world.dynamics import EgoModel, longitudinal_acceleration
from di_envs.world.state import ActorKind

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
    crosswalks: tuple[float, ...] = (),
    limit_mps: float = LIMIT_MPS,
) -> DrivePath:
    """A straight path.

    Args:
        line_m: Station of a stop line.
        kind: What governs it.
        junction: Stations between which a junction lies (lane 1; lanes 0 and 2 before and behind).
        change: A lane change's jump, latest begin, limit and shift [m]; before the jump the path
            runs on the old lane, at y = shift.
        crosswalks: Stations of their middles.
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
        crosswalk_m=np.array(crosswalks, np.float64),
        end_m=np.array([LENGTH_M]),
    )


def make_crossings(crossing: tuple[float, float] | None = None) -> Crossings:
    """Lanes 0, 1, 2 of the path and one stream, which crosses lane 1 of the junction.

    It comes from the left along x = 110, from 45 m before the junction, which for it begins at
    y = -7: so its station is y + 7.

    Args:
        crossing: Stations on lane 1 between which the stream meets it, at its own 5 to 9 m.
    """
    meets = [] if crossing is None else [crossing]
    begins = np.arange(66.0) - 45.0
    return Crossings(
        own_rank=np.zeros(3, np.int8),
        meet_start=np.array([0, 0, len(meets), len(meets)], np.int32),
        stream=np.zeros(len(meets), np.int32),
        begin_m=np.array([100.0 + m[0] for m in meets], np.float64),
        end_m=np.array([100.0 + m[1] for m in meets], np.float64),
        other_begin_m=np.full(len(meets), 5.0),
        other_end_m=np.full(len(meets), 9.0),
        first=np.zeros(1, np.int32),
        points=np.array([begins.size], np.int32),
        back_m=np.array([45.0]),
        turn=np.zeros(1, np.int8),
        rank=np.zeros(1, np.int8),
        light=np.array([-1], np.int32),
        sign=np.zeros(1, np.int8),
        x=np.full(begins.size, 110.0),
        y=begins - 7.0,
        z=np.zeros(begins.size),
        yaw=np.full(begins.size, np.pi / 2.0),
    )


def make_actors(others: int = 0) -> Visible:
    """The ego at the path's start, and cars that are far away until they are put somewhere.

    There is one light, and it is green.
    """
    actors = empty_visible(1 + others, 1)
    for column in actors:
        column[...] = 0
    actors.seen[0] = 1 + others
    actors.kind[:] = ActorKind.CAR
    actors.x[1:] = -1e4
    actors.half_length[:], actors.half_width[:], actors.height[:] = 2.4, 1.0, 1.5
    actors.half_length[0], actors.half_width[0] = HALF_M, MODEL.half_width_m
    actors.light[0] = LightState.GREEN
    return actors


def frozen(path: DrivePath) -> DrivePath:
    """The path as `build_path` makes it, read-only, so that it is the same machine code."""
    for array in path:
        array.flags.writeable = False
    return path


class Drive:
    """The ego on the path, a decision of 0.1 s at a time."""

    def __init__(
        self,
        path: DrivePath,
        actors: Visible,
        *,
        crossings: Crossings | None = None,
        config: ExpertConfig = CONFIG,
    ) -> None:
        self.path, self.actors = frozen(path), actors
        self.crossings = crossings or make_crossings()
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
            self.path,
            self.progress,
            self.crossings,
            self.actors,
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
        self.actors.x[0] += moved

    def run(self, seconds: float) -> None:
        """Drives on for a while."""
        for _ in range(round(seconds / 0.1)):
            self.step()
