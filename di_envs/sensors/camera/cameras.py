"""Pinhole cameras: RGB, depth, semantic and instance images of the scene in one pass.

A rig collects what stands round its ego once, and each of its cameras paints that
(`rows.py`). See `docs/conventions.md` for frames.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.kernels import bind
from di_envs.sensors.camera.canvas import Canvas, Studio, canvas_of
from di_envs.sensors.camera.config import Rig
from di_envs.sensors.camera.projection import projected_buffer
from di_envs.sensors.camera.rows import FAR_M as FAR_M
from di_envs.sensors.camera.rows import render
from di_envs.sensors.scene.scene import box_buffer, collect_boxes, scene_of
from di_envs.sensors.weather import Weather, look_of
from di_envs.town.town import Town
from di_envs.world.world import WorldView

RANGE_M = 220.0  # boxes further from the ego are not seen


class CameraRig:
    """Some cameras on an ego. Keeps no memory: only buffers and static tables."""

    def __init__(self, town: Town, rig: Rig, weather: Weather, ego: int = 0) -> None:
        """Builds the town's scene, unless that was done before.

        Args:
            town: The town.
            rig: Its cameras.
            weather: The weather that they see.
            ego: Index of the ego that carries them.
        """
        self.rig = rig
        self._ego = ego
        self._scene = scene_of(town)
        self._look = look_of(weather)
        self._boxes, self._seen = box_buffer(), projected_buffer()
        # rain is keyed by the camera's name: another one beside it changes none of its drops
        self._keys = [zlib.crc32(camera.name.encode()) for camera in rig.cameras]

    def start(self, view: WorldView) -> None:
        """Takes up an episode: the view's state arrays."""
        self._studio = Studio(
            state=view.state,
            scene=self._scene,
            look=self._look,
            boxes=self._boxes,
            seen=self._seen,
        )
        self._canvases = [canvas_of(camera, self.rig) for camera in self.rig.cameras]
        canvas = self._canvases[0]
        self._collect = bind(
            collect_boxes, self._scene, view.state, self._ego, RANGE_M, self._boxes
        )
        self._render = bind(render, self._studio, canvas, self._ego, 0)

    def change_weather(self, weather: Weather) -> None:
        """What is seen from now on; for much less than another `start`."""
        self._look = look_of(weather)
        self._studio = self._studio._replace(look=self._look)

    def observe(self, only: str | None = None) -> dict[str, NDArray[Any]]:
        """The present images; every array is a fresh one.

        Args:
            only: Name of the one camera that is wanted; None for all.
        """
        self._collect(self._scene, self._studio.state, self._ego, RANGE_M, self._boxes)
        images: dict[str, NDArray[Any]] = {}
        for number, camera in enumerate(self.rig.cameras):
            if only is not None and camera.name != only:
                continue
            canvas = self._fresh(self._canvases[number])
            self._render(self._studio, canvas, self._ego, self._keys[number])
            images[camera.name] = canvas.rgb.reshape(camera.height, camera.width, 3)
            if self.rig.depth:
                images[f"{camera.name}_depth"] = canvas.depth
            if self.rig.semantic:
                images[f"{camera.name}_semantic"] = canvas.tag
            if self.rig.instance:
                images[f"{camera.name}_instance"] = canvas.instance
        return images

    def _fresh(self, canvas: Canvas) -> Canvas:
        """The canvas with new arrays for what is handed out; the rest is used again and again."""
        images: dict[str, Any] = {"rgb": np.empty_like(canvas.rgb)}
        if self.rig.depth:
            images["depth"] = np.empty_like(canvas.depth)
        if self.rig.semantic:
            images["tag"] = np.empty_like(canvas.tag)
        if self.rig.instance:
            images["instance"] = np.empty_like(canvas.instance)
        return canvas._replace(**images)
