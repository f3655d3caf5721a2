"""Gathers an explanation as a drive is retraced: pictures, what is told, looks into the policy."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from agents.base import Agent, Observation
from di_envs.prompt import COMPONENTS
from di_envs.route_env import RouteEnv
from di_envs.world.world import WorldView
from leaderboard.explaining.explanation import ActivationMaps, Explanation, WhatIf
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.film import Film, film_every
from leaderboard.replaying.retracing import Decision
from leaderboard.running.front_camera import FRONT, front_camera

if TYPE_CHECKING:
    from agents.explain.look import Look
    from agents.explain.protocol import FeatureMap

JPEG_QUALITY = 72
PRESENT = "prompt_present"


class DriveLooks:
    """The looks at one drive, as they are gathered: what an explanation is made of."""

    def __init__(
        self,
        run: RunRecord,
        record: RouteRecord,
        env: RouteEnv,
        agent: Agent[Any],
        every_s: float,
        at: int | None,
    ) -> None:
        self.run, self.record, self.env, self.agent = run, record, env, agent
        self._every = max(1, round(every_s / env.config.control_dt_s))
        self._film_every = film_every(env.config.control_dt_s)
        self._at = at
        self._film = Film()
        self._numbers: list[int] = []
        self._times_s: list[float] = []
        self._poses: list[tuple[float, float, float]] = []
        self._controls: list[NDArray[np.float32]] = []
        self._images: list[bytes] = []
        self._looks: list[Look] = []
        self._seen: dict[str, list[Any]] = {}
        self.problem = _why_not(run, agent)

    def add(self, decision: Decision) -> None:
        """Takes up a moment."""
        step = decision.step
        if decision.number % self._film_every == 0 or step.over or decision.control is None:
            self._film.add(step)
        if decision.control is None:
            return
        if decision.number % self._every and decision.number != self._at:
            return
        self._numbers.append(decision.number)
        self._times_s.append(decision.time_s)
        self._poses.append(_pose(step.view))
        self._controls.append(decision.control)
        self._images += _front_image(decision)
        if PRESENT in decision.seen:  # the speedometer alone is no prompt
            for name in (*COMPONENTS, PRESENT):
                self._seen.setdefault(name, []).append(np.array(decision.seen[name]))
        look = self.look(self.agent, decision.seen, decision.memory)
        self._looks += [] if look is None else [look]

    def look(self, agent: Agent[Any], seen: Observation, memory: Any) -> Look | None:
        """What is seen of a decision inside the policy."""
        if self.problem:
            return None
        from agents.explain.look import look_at

        return look_at(agent, seen, memory)

    def explanation(self, what_if: WhatIf | None, open_at_s: float) -> Explanation:
        """What was gathered."""
        responses = [look.response for look in self._looks]
        first = responses[0] if responses else None
        return Explanation(
            run=self.run,
            record=self.record,
            town=self.env.world.town,
            film=self._film,
            times_s=np.array(self._times_s),
            decisions=np.array(self._numbers),
            poses=np.array(self._poses).reshape(-1, 3),
            controls=np.array(self._controls, np.float32).reshape(-1, 3),
            seen={name: np.stack(rows) for name, rows in self._seen.items()},
            images=tuple(self._images),
            camera=front_camera(self.env.config.cameras) if self._images else None,
            groups=first.groups if first else (),
            gradient=_stacked([r.gradient for r in responses], (0, 0, 2)),
            attention=_stacked([r.attention for r in responses], (0, 0, 0, 0)),
            waypoints=_stacked([r.waypoints for r in responses], (0, 0, 2)),
            maps=self._maps(),
            what_if=what_if,
            missing=tuple(self._missing()),
            open_at_s=open_at_s,
        )

    def place_of(self, number: int) -> int:
        """Where a decision stands in the arrays."""
        return self._numbers.index(number)

    def _maps(self) -> dict[str, ActivationMaps]:
        if not self._looks:
            return {}
        from agents.explain.protocol import explainable

        parts: Mapping[str, FeatureMap] = explainable(self.agent).anatomy.maps
        return {
            name: ActivationMaps(
                values=np.stack([look.maps[name] for look in self._looks]),
                extent_m=part.extent_m,
                camera=part.camera,
            )
            for name, part in parts.items()
        }

    def _missing(self) -> Iterator[str]:
        if self.problem:
            yield f"No waypoints, gradients, attention or activation maps: {self.problem}"
        elif self._looks and not self._looks[0].maps:
            yield "No activation maps: the policy has no cameras and no LiDAR."
        if not self._seen:
            yield "Nothing is drawn of what the agent is told: it takes no prompt."
        sensors = {"camera"} & set(self.run.requires["observations"])
        if not sensors and self._images:
            yield "The agent has no camera: the picture is for you, it never saw it."


def _why_not(run: RunRecord, agent: Agent[Any]) -> str:
    """Why a policy cannot be looked into; empty if it can."""
    if getattr(agent, "explainable", None) is None:
        return (
            f"agent '{run.agent}' has no torch policy that says where its tokens are "
            "(docs/explaining.md shows how yours gets explainable())"
        )
    from agents.explain.protocol import NotExplainableError, explainable

    try:
        explainable(agent)
    except NotExplainableError as error:
        return str(error)
    return ""


def _front_image(decision: Decision) -> list[bytes]:
    """The front camera's picture as the agent saw it, else as it would have."""
    image = decision.seen.get(FRONT, decision.step.observation.get(FRONT))
    if image is None:
        return []
    written = io.BytesIO()
    Image.fromarray(np.asarray(image)).save(written, "JPEG", quality=JPEG_QUALITY)
    return [written.getvalue()]


def _pose(view: WorldView) -> tuple[float, float, float]:
    state, ego = view.state, view.ego
    return float(state.x[ego]), float(state.y[ego]), float(state.yaw[ego])


def _stacked(arrays: list[NDArray[np.float32]], none: tuple[int, ...]) -> NDArray[np.float32]:
    return np.stack(arrays) if arrays else np.zeros(none, np.float32)
