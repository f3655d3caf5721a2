"""Edits that lose a part of what is seen, at random or in time: mask, thin, blackout, delay."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from di_envs.edits.text import EditError
from wrappers.interventions.context import EditContext
from wrappers.interventions.edit import Draws, Observation, ObservationEdit, setting
from wrappers.interventions.layout import beside, has_valid, is_camera

BLOCK = 16  # pixels: a side of what is masked of an image at once


@dataclass(frozen=True, kw_only=True)
class Mask(ObservationEdit):
    """Each row of a table (polyline of the map), or block of an image, is lost at random.

    Attributes:
        p: How probably; drawn anew at every moment.
        seed: Another one draws others.
    """

    verb = "mask"
    stays = True
    p: float = setting("p", low=0.0, high=1.0)
    seed: int = setting("seed", kind=int, default=0, low=0)

    def check(self, name: str, space: spaces.Dict) -> None:
        if not (has_valid(name) or is_camera(space[name])):
            hint = f"; write thin:lidar,keep={1.0 - self.p:g}" if name == "lidar" else ""
            raise EditError(f"'{self}': {name} has no rows and is no image{hint}")

    def edited(self, name: str, value: Any, draws: Draws, context: EditContext) -> Any:
        batch = np.ndim(context.tick)
        if has_valid(name):
            lost = draws.uniforms(value.shape[batch]) < self.p
        else:
            height, width = value.shape[batch : batch + 2]
            blocks = draws.uniforms(-(-height // BLOCK), -(-width // BLOCK)) < self.p
            lost = blocks.repeat(BLOCK, axis=-2).repeat(BLOCK, axis=-1)[..., :height, :width]
        value[lost] = 0
        return value


@dataclass(frozen=True, kw_only=True)
class Thin(ObservationEdit):
    """Of the LiDAR's rays only some come back, drawn anew at every moment.

    Attributes:
        keep: Which share does.
        seed: Another one draws others.
    """

    verb = "thin"
    stays = True
    keep: float = setting("keep", low=0.0, high=1.0)
    seed: int = setting("seed", kind=int, default=0, low=0)

    def check(self, name: str, space: spaces.Dict) -> None:
        if name != "lidar":
            raise EditError(f"'{self}': {name} has no rays; write thin:lidar,keep={self.keep:g}")

    def changes(
        self, names: tuple[str, ...], observation: Observation, context: EditContext, memory: Any
    ) -> tuple[dict[str, Any], Any]:
        points = observation["lidar"].copy()
        draws = Draws(edit=self, target="lidar", context=context)
        lost = draws.uniforms(points.shape[-2]) >= self.keep
        points[lost] = 0
        shown = {"lidar": points}
        if "lidar_semantic" in observation:
            tags = observation["lidar_semantic"].copy()
            tags[lost] = 0
            shown["lidar_semantic"] = tags
        return shown, memory


@dataclass(frozen=True, kw_only=True)
class Blackout(ObservationEdit):
    """A camera's image is black; so is what it says of depth and of kinds."""

    verb = "blackout"
    stays = True

    def check(self, name: str, space: spaces.Dict) -> None:
        if not is_camera(space[name]):
            raise EditError(f"'{self}': {name} is no camera's image")

    def changes(
        self, names: tuple[str, ...], observation: Observation, context: EditContext, memory: Any
    ) -> tuple[dict[str, Any], Any]:
        parts = [
            key for key in observation
            if any(key == name or key.startswith(f"{name}_") for name in names)
        ]  # fmt: skip
        return {key: np.zeros_like(observation[key]) for key in parts}, memory


@dataclass(frozen=True, kw_only=True)
class Delay(ObservationEdit):
    """What is seen is old; until there is anything so old, it is what the episode began with.

    Its memory is a ring of the last moments, each in the place that its number of decisions gives:
    to look twice at a moment changes nothing, and a world of many may begin anew by itself.

    Attributes:
        steps: How many decisions old.
    """

    verb = "delay"
    stays = True
    remembers = True
    steps: int = setting("steps", kind=int, low=0)

    def changes(
        self, names: tuple[str, ...], observation: Observation, context: EditContext, memory: Any
    ) -> tuple[dict[str, Any], Any]:
        now = {name: np.array(observation[name]) for name in names}
        ring = list(memory or [now] * (self.steps + 1))
        wanted = np.maximum(np.subtract(context.decision, self.steps), 0)
        if np.ndim(wanted) == 0:
            ring[int(context.decision) % len(ring)] = now
            old = ring[int(wanted) % len(ring)]
            return {name: value.copy() for name, value in old.items()}, tuple(ring)
        slots = np.asarray(context.decision) % len(ring)
        for slot in np.unique(slots).tolist():
            ring[slot] = {
                name: np.where(beside(slots == slot, new), new, ring[slot][name])
                for name, new in now.items()
            }
        shown = dict(now)
        for slot in np.unique(wanted % len(ring)).tolist():
            rows = wanted % len(ring) == slot
            shown = {
                name: np.where(beside(rows, old), ring[slot][name], old)
                for name, old in shown.items()
            }
        return shown, tuple(ring)
