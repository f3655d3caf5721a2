"""A window that shows frames as they come, for `render_mode="human"`, and what people press in it.

It answers its own keys (P, +, -, C, Esc); which others are down is for whoever drives by them.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

KEYS = "P pauses, + and - change the speed, C changes the camera, Esc closes"
SLOWEST, FASTEST = 1 / 8, 16.0
_PAUSED_FPS = 30.0
_AXIS_MOST = 32767.0  # as SDL says how far a stick is pushed
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
    """Opens with the first frame. Once the user has closed it, further frames go unseen.

    Attributes:
        closed: Whether it is closed, by the user or by `close`.
        camera: Whether the front camera's picture is to be the large one; C changes it.
        speed: How many times as fast as the frames say it shows them.
        held: Names of the keys that are down, as pygame names them: `left`, `a`, `space`.
    """

    def __init__(self, title: str, *, camera: bool = False) -> None:
        """Looks whether there is a display.

        Raises:
            RuntimeError: If there is none, or no pygame; says what to do.
        """
        self._pygame = _pygame()
        self._title = title
        self._surface: Any = None
        self._pad: Any = None
        self.closed, self.camera, self.paused, self.speed = False, camera, False, 1.0
        self.held: set[str] = set()
        try:
            self._pygame.display.init()
        except self._pygame.error as error:
            raise RuntimeError(_NO_DISPLAY.format(reason=error)) from error
        if self._pygame.display.get_driver() == "offscreen":  # what SDL takes where there is none
            self.close()
            raise RuntimeError(_NO_DISPLAY.format(reason="SDL found none"))
        self._clock = self._pygame.time.Clock()

    def show(self, picture: Callable[[], NDArray[np.uint8]], fps: float) -> None:
        """Shows a moment until its time is up, and as long as the user has paused.

        Args:
            picture: Draws it, (H, W, 3) RGB; anew when the camera changes in a pause.
            fps: Frames a second.
        """
        if self.closed:
            return
        drawn = self.camera
        self._paint(picture())
        self._clock.tick(fps * self.speed)
        self._answer()
        while self.paused and not self.closed:
            if self.camera != drawn:
                self._paint(picture())
                drawn = self.camera
            self._clock.tick(_PAUSED_FPS)
            self._answer()

    def pad(self) -> tuple[float, float, float] | None:
        """The first gamepad's left stick, -1 to 1, right and left trigger, 0 to 1; None without."""
        pygame = self._pygame
        if self._pad is None or not self._pad.attached():
            self._pad = _first_pad(pygame)
        if self._pad is None:
            return None
        axes = (
            pygame.CONTROLLER_AXIS_LEFTX,
            pygame.CONTROLLER_AXIS_TRIGGERRIGHT,
            pygame.CONTROLLER_AXIS_TRIGGERLEFT,
        )
        stick, right, left = (self._pad.get_axis(axis) / _AXIS_MOST for axis in axes)
        return max(-1.0, stick), max(0.0, right), max(0.0, left)

    def close(self) -> None:
        """Closes the window for good."""
        if not self.closed:
            self.closed = True
            self._pygame.display.quit()

    def _paint(self, frame: NDArray[np.uint8]) -> None:
        pygame, size = self._pygame, (frame.shape[1], frame.shape[0])
        if self._surface is None:
            self._surface = pygame.display.set_mode(size)
            self._name()
        self._surface.blit(pygame.image.frombuffer(frame.tobytes(), size, "RGB"), (0, 0))
        pygame.display.flip()

    def _answer(self) -> None:
        """Does what the user has asked for since the last time."""
        pygame = self._pygame
        for event in pygame.event.get():
            if event.type == pygame.QUIT:
                self.close()
            elif event.type == pygame.KEYDOWN:
                self._press(pygame.key.name(event.key), getattr(event, "unicode", ""))
            elif event.type == pygame.KEYUP:
                self.held.discard(pygame.key.name(event.key))
            elif event.type == pygame.WINDOWFOCUSLOST:
                self.held.clear()  # it is not told when they are let go
            if self.closed:
                return

    def _press(self, key: str, letter: str) -> None:
        self.held.add(key)
        if key == "escape":
            self.close()
            return
        if key == "p":
            self.paused = not self.paused
        elif key == "c":
            self.camera = not self.camera
        elif "+" in (letter, key) or key in ("=", "[+]"):
            self.speed = min(FASTEST, 2.0 * self.speed)
        elif "-" in (letter, key) or key == "[-]":
            self.speed = max(SLOWEST, 0.5 * self.speed)
        self._name()

    def _name(self) -> None:
        """Says in the title what is not as usual, and which keys there are."""
        states = [f"{self.speed:g} times as fast"] if self.speed != 1.0 else []
        states += ["paused"] if self.paused else []
        self._pygame.display.set_caption(" · ".join((self._title, *states, KEYS)))


def _first_pad(pygame: Any) -> Any:
    """The first of the gamepads that SDL knows the buttons of; None if there is none."""
    from pygame._sdl2 import controller

    controller.init()
    pads = (i for i in range(pygame.joystick.get_count()) if controller.is_controller(i))
    first = next(pads, None)
    return None if first is None else controller.Controller(first)


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
