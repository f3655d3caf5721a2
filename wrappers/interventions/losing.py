"""Edits that lose a part of what is seen, at random or in time: mask, thin, blackout, delay."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from di_envs.edit_text import EditError
from wrappers.interventions.context import EditContext
from wrappers.interventions.edit import Draws, Observation, ObservationEdit, setting
from wrappers.interventions.layout import has_valid, is_camera

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

    Its memory holds the last moments, the newest first. Which one is shown follows from how many
    decisions an episode has had, so a world of many may begin anew and its memory be forgotten.

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
        moments = (now, *(memory or ()))[: self.steps + 1]
        ages = np.minimum(np.minimum(context.decision, self.steps), len(moments) - 1)
        shown = {}
        for name in names:
            if np.ndim(ages) == 0:
                shown[name] = moments[int(ages)][name].copy()
                continue
            rows = [moments[age][name][row] for row, age in np.ndenumerate(ages)]
            shown[name] = np.stack(rows).reshape(now[name].shape).astype(now[name].dtype)
        return shown, moments
