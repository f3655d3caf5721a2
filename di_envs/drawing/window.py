"""A window that shows frames as they come, for `render_mode="human"`."""

from __future__ import annotations

import os
import sys
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

_NO_DISPLAY = (
    "There is no display to open a window on ({reason}). Use render_mode='rgb_array' for frames, "
    "`driveinsight drive --video FILE` for a video, or a virtual display (`xvfb-run python …`)."
)

_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")  # by which a desktop says where it is


def display_is_likely() -> bool:
    """Whether a window could open, as far as can be told without trying: it loads no pygame."""
    if sys.platform in ("win32", "darwin"):
        return True
    driver = os.environ.get("SDL_VIDEODRIVER", "")
    return (bool(driver) and driver != "offscreen") or any(map(os.environ.get, _DISPLAYS))


class Window:
    """Opens with the first frame. Once the user has closed it, further frames go unseen."""

    def __init__(self, title: str) -> None:
        """Looks whether there is a display.

        Raises:
            RuntimeError: If there is none, or no pygame; says what to do.
        """
        self._pygame = _pygame()
        self._title = title
        self._surface: Any = None
        self._closed = False
        try:
            self._pygame.display.init()
        except self._pygame.error as error:
            raise RuntimeError(_NO_DISPLAY.format(reason=error)) from error
        if self._pygame.display.get_driver() == "offscreen":  # what SDL takes where there is none
            self.close()
            raise RuntimeError(_NO_DISPLAY.format(reason="SDL found none"))
        self._clock = self._pygame.time.Clock()

    def show(self, frame: NDArray[np.uint8], fps: float) -> None:
        """Shows a frame, and waits until its time is up.

        Args:
            frame: (H, W, 3) RGB.
            fps: Frames a second.
        """
        if self._closed:
            return
        pygame, size = self._pygame, (frame.shape[1], frame.shape[0])
        if self._surface is None:
            self._surface = pygame.display.set_mode(size)
            pygame.display.set_caption(self._title)
        self._surface.blit(pygame.image.frombuffer(frame.tobytes(), size, "RGB"), (0, 0))
        pygame.display.flip()
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
            return
        self._clock.tick(fps)

    def close(self) -> None:
        """Closes the window for good."""
        if not self._closed:
            self._closed = True
            self._pygame.display.quit()


def _pygame() -> Any:
    """pygame, without its greeting."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it imports what setuptools deprecates
            import pygame
    except ImportError as error:
        raise RuntimeError(
            "render_mode='human' needs pygame: pip install pygame-ce, or use 'rgb_array'."
        ) from error
    return pygame
