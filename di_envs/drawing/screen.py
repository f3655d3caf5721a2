"""Where pictures of an environment go: to the caller or into a window."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from di_envs.config import check_name
from di_envs.course import Course
from di_envs.drawing.window import Window, display_is_likely
from di_envs.world.world import WorldView

if TYPE_CHECKING:
    from di_envs.drawing.window import Window

RENDER_MODES = ("human", "rgb_array")


def check_render_mode(render_mode: str | None) -> None:
    """Refuses a render mode that there is not.

    Raises:
        ValueError: With what there is.
    """
    if render_mode is not None:
        check_name(render_mode, RENDER_MODES, "render_mode")


def render_modes(asked: str | None) -> list[str]:
    """The modes that work here, for `metadata`: without a display there is no window to offer.

    Args:
        asked: The mode that the environment was made with, which is among them.
    """
    window = asked == "human" or display_is_likely()
    return [mode for mode in RENDER_MODES if window or mode != "human"]


class Screen:
    """Draws a world for people in one of the render modes.

    Attributes:
        window: Where it is shown; None if it is handed to the caller.
    """

    def __init__(self, course: Course, render_mode: str, *, camera: bool = False) -> None:
        """Opens the window, if the mode is `human`.

        Args:
            course: What is driven.
            render_mode: One of `RENDER_MODES`.
            camera: Whether the window begins with the front camera's picture as the large one.

        Raises:
            RuntimeError: If there is no display for it.
        """
        # here, as who renders nothing needs none of it
        from di_envs.drawing.driver_view import DriverView
        from di_envs.drawing.view import Renderer

        self.window: Window | None = None
        if render_mode == "human":
            self.window = Window("DriveInsight", camera=camera)
        self._renderer = Renderer(course)
        self._driver_view = DriverView(course, self._renderer)
        self._fps = 1.0 / course.config.control_dt_s

    def draw(self, view: WorldView, ego: int, observation: Mapping[str, Any]) -> Any:
        """Returns a picture (H, W, 3) uint8, or shows it in the window and returns None."""
        window = self.window
        if window is None:
            return self._renderer.frame(view, ego, observation)

        def picture() -> Any:
            if window.camera:
                return self._driver_view.frame(view, ego)
            return self._renderer.frame(view, ego, observation)

        window.show(picture, self._fps)
        return None

    def close(self) -> None:
        """Closes the window."""
        if self.window is not None:
            self.window.close()
