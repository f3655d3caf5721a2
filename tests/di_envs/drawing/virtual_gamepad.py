"""A gamepad without hardware: SDL's virtual joystick, which no game can tell from a real one."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

_GAMEPAD, _AXES, _BUTTONS = 1, 6, 15  # SDL_JOYSTICK_TYPE_GAMECONTROLLER, and what one has
_PLACES = {"stick": 0, "left_trigger": 4, "right_trigger": 5}  # SDL_GameControllerAxis
_MOST = 32767


class VirtualGamepad:
    """What a hand does to it."""

    def __init__(self, sdl: Any, number: int) -> None:
        sdl.SDL_JoystickOpen.restype = ctypes.c_void_p
        self._sdl, self._stick = sdl, ctypes.c_void_p(sdl.SDL_JoystickOpen(number))
        self.push(stick=0.0, left_trigger=0.0, right_trigger=0.0)

    def push(self, **axes: float) -> None:
        """Moves axes: the stick to -1 … 1, a trigger, which rests at -1 of its way, to 0 … 1."""
        for name, share in axes.items():
            way = 2.0 * share - 1.0 if "trigger" in name else share
            value = ctypes.c_int16(round(_MOST * way))
            assert self._sdl.SDL_JoystickSetVirtualAxis(self._stick, _PLACES[name], value) == 0


@contextmanager
def virtual_gamepad() -> Iterator[VirtualGamepad]:
    """One that is plugged in until the block ends; pygame's display has to be there."""
    from pygame._sdl2 import controller

    sdl = _pygames_sdl()
    controller.init()
    number = sdl.SDL_JoystickAttachVirtual(_GAMEPAD, _AXES, _BUTTONS, 0)
    assert number >= 0
    try:
        yield VirtualGamepad(sdl, number)
    finally:
        sdl.SDL_JoystickDetachVirtual(number)


def _pygames_sdl() -> Any:
    """The very library that pygame has loaded, which alone knows its windows and gamepads."""
    try:
        maps = Path("/proc/self/maps").read_text(encoding="utf-8")
    except OSError:
        pytest.skip("which SDL pygame has loaded is told by Linux alone")
    places = [line.split()[-1] for line in maps.splitlines() if "libSDL2-2" in line]
    if not places:
        pytest.skip("pygame has no SDL 2 of its own here")
    return ctypes.CDLL(places[0])
