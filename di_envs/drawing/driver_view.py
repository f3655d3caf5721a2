"""The view from behind the wheel: the front camera large, below it the streets, heading up.

The camera is one for people, whatever the environment shows to agents: wide enough to drive by.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from di_envs.course import Course
from di_envs.drawing.view import HEIGHT_PX, MAP_PX, MARGIN, PANEL, WIDTH_PX, Renderer
from di_envs.observer import Observer
from di_envs.sensors.camera.config import CameraConfig, Rig
from di_envs.world.world import WorldView

FRONT = CameraConfig(
    name="camera_front", width=MAP_PX, height=360, fov_deg=100.0, pitch_rad=math.radians(-3.0)
)
# Of the map, with the ego in its middle: more of what is ahead, and no corner of a turned one
_MIDDLE = MAP_PX // 2
_STREETS = (_MIDDLE - 260, _MIDDLE - 170, _MIDDLE + 260, _MIDDLE + 58)


class DriverView:
    """Draws what one who drives by hand looks at."""

    def __init__(self, course: Course, renderer: Renderer) -> None:
        self._renderer = renderer
        self._observer = Observer(
            course.town, ("camera",), cameras=Rig(cameras=(FRONT,)), weather=course.weather
        )
        self._shown: tuple[WorldView, int] | None = None  # what the observer has taken up

    def frame(self, view: WorldView, ego: int = 0) -> NDArray[np.uint8]:
        """A picture of the present state, (HEIGHT_PX, WIDTH_PX, 3) RGB.

        Args:
            view: The world.
            ego: Who drives.
        """
        picture = Image.new("RGB", (WIDTH_PX, HEIGHT_PX), PANEL)
        picture.paste(Image.fromarray(self._ahead(view, ego)), (0, 0))
        heading_up = 90.0 + math.degrees(float(view.state.yaw[ego]))
        streets = self._renderer.map(view, ego).rotate(heading_up, Image.Resampling.BICUBIC)
        streets = streets.crop(_STREETS).resize((MAP_PX, HEIGHT_PX - FRONT.height))
        picture.paste(streets, (0, FRONT.height))
        self._renderer.write(picture, view, ego, MARGIN)
        return np.array(picture)

    def _ahead(self, view: WorldView, ego: int) -> Any:
        if self._shown is None or self._shown[0] is not view or self._shown[1] != ego:
            self._observer = self._observer.of_ego(ego)
            self._observer.start(view)
            self._shown = view, ego
        return self._observer.front()[FRONT.name]
