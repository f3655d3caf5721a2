"""Where pictures of an environment go: to the caller or into a window."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from di_envs.config import check_name
from di_envs.course import Course
from di_envs.drawing.window import Window, display_is_likely
from di_envs.world.world import WorldView

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
    """Draws a world for people in one of the render modes."""

    def __init__(self, course: Course, render_mode: str) -> None:
        """Opens the window, if the mode is `human`.

        Raises:
            RuntimeError: If there is no display for it.
        """
        # here, as who renders nothing needs none of it
        from di_envs.drawing.view import Renderer

        self._window = Window("DriveInsight") if render_mode == "human" else None
        self._renderer = Renderer(course)
        self._fps = 1.0 / course.config.control_dt_s

    def draw(self, view: WorldView, ego: int, observation: Mapping[str, Any]) -> Any:
        """Returns a picture (H, W, 3) uint8, or shows it in the window and returns None."""
        frame = self._renderer.frame(view, ego, observation)
        if self._window is None:
            return frame
        self._window.show(frame, self._fps)
        return None

    def close(self) -> None:
        """Closes the window."""
        if self._window is not None:
            self._window.close()
