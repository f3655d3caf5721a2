"""What an explained route is: arrays with a row for each moment looked at, and futures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from di_envs.sensors.camera.config import CameraConfig
from di_envs.town.town import Town
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.film import Film
from leaderboard.replaying.futures import Future

if TYPE_CHECKING:
    from agents.explain.look import DecisionLook


class ExplainError(Exception):
    """A route or a moment that cannot be explained; the message says what to do."""


@dataclass(frozen=True, kw_only=True)
class ActivationMaps:
    """The activation maps of one map of features, moment by moment.

    Attributes:
        values: (N, rows, columns) 0 or more.
        extent_m: Of a map of the ground: x_min, x_max, y_min, y_max in the ego frame; rows go
            ahead, columns right. None for one of an image, whose rows go down and columns right.
        camera: Of one of an image: its key in the observation.
    """

    values: NDArray[np.float32]
    extent_m: tuple[float, float, float, float] | None = None
    camera: str | None = None


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What the agent would do at the moment, and how it goes on.

    Attributes:
        edit: What is asked about, as it was written; empty for the drive as it was.
        control: (3,) throttle, steer, brake at the moment; None where the agent fails.
        look: What is seen of the decision inside the policy; None where nothing can be.
        future: From the moment on.
    """

    edit: str
    control: NDArray[np.float32] | None
    look: DecisionLook | None
    future: Future


@dataclass(frozen=True, kw_only=True)
class WhatIf:
    """Futures of one moment.

    Attributes:
        at_s: The moment.
        moment: Its place in the explanation's arrays.
        base: The drive as it was.
        answers: One for each edit.
    """

    at_s: float
    moment: int
    base: Answer
    answers: tuple[Answer, ...]


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """A route, explained. Its arrays have a row for each of N moments at which was looked.

    Attributes:
        run: The run.
        record: Its route.
        town: Where it leads through.
        film: What was to be seen, every tenth of a second.
        times_s: (N,) game time.
        decisions: (N,) how many decisions came before.
        poses: (N, 3) x, y [m], yaw [rad] of the ego, world frame.
        controls: (N, 3) throttle, steer, brake.
        seen: Component of the prompt to (N, ...) what the agent was told, in the form of the
            observation, and `prompt_present`; empty for an agent without a prompt.
        images: N JPEG images of the front camera: what the agent saw, where it has one.
        camera: That took them; None if there is none.
        groups: Names of the G components that can be responded to; none where the policy cannot be
            looked into.
        gradient: (N, G, 2) Gx and Gy.
        attention: (N, layers, heads, G) shares of each head's attention.
        waypoints: (N, T, 2) predicted, x ahead and y right of the ego [m].
        maps: Name to activation maps.
        what_if: Futures of a moment; None where none was asked for.
        missing: What there is not, and why, a sentence each.
        open_at_s: The moment that its page shows first.
    """

    run: RunRecord
    record: RouteRecord
    town: Town
    film: Film
    times_s: NDArray[np.float64]
    decisions: NDArray[np.int64]
    poses: NDArray[np.float64]
    controls: NDArray[np.float32]
    seen: Mapping[str, NDArray[Any]]
    images: tuple[bytes, ...]
    camera: CameraConfig | None
    groups: tuple[str, ...]
    gradient: NDArray[np.float32]
    attention: NDArray[np.float32]
    waypoints: NDArray[np.float32]
    maps: Mapping[str, ActivationMaps]
    what_if: WhatIf | None
    missing: tuple[str, ...]
    open_at_s: float = 0.0
