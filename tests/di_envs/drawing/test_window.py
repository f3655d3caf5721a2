"""The window answers what people press; SDL's dummy driver stands in for a display."""

from __future__ import annotations

import numpy as np
import pytest

from di_envs.drawing.window import FASTEST, SLOWEST, Window
from tests.di_envs.drawing.virtual_gamepad import virtual_gamepad

FRAME = np.zeros((8, 8, 3), np.uint8)


@pytest.fixture
def window(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    window = Window("test")
    yield window
    window.close()


def press(window, *names, let_go=True):
    """Posts real events, as a keyboard would."""
    pygame = window._pygame
    for name in names:
        key = pygame.key.key_code(name)
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key, unicode=name))
        if let_go:
            pygame.event.post(pygame.event.Event(pygame.KEYUP, key=key))


def show(window, fps=1000.0):
    drawn = []

    def picture():
        drawn.append(window.camera)
        return FRAME

    window.show(picture, fps)
    return drawn


def test_keys_that_are_down_are_held_until_they_are_let_go(window):
    show(window)
    press(window, "up", "a", let_go=False)
    show(window)
    assert window.held == {"up", "a"}
    pygame = window._pygame
    pygame.event.post(pygame.event.Event(pygame.KEYUP, key=pygame.K_UP))
    show(window)
    assert window.held == {"a"}
    pygame.event.post(pygame.event.Event(pygame.WINDOWFOCUSLOST))
    show(window)
    assert window.held == set()


def test_plus_and_minus_double_and_halve_the_speed_within_limits(window):
    show(window)
    press(window, "+", "=")
    show(window)
    assert window.speed == 4.0
    assert "4 times as fast" in window._pygame.display.get_caption()[0]
    press(window, *["+"] * 9)
    show(window)
    assert window.speed == FASTEST
    press(window, *["-"] * 12)
    show(window)
    assert window.speed == SLOWEST


def test_p_holds_the_moment_until_it_is_pressed_again_and_c_still_changes_the_camera(window):
    show(window)
    press(window, "p", "c")  # in one go: paused, and the camera is another
    drawn = []

    def picture():
        drawn.append((window.camera, window.paused))
        if window.paused:
            press(window, "p")
        return FRAME

    window.show(picture, 1000.0)
    assert drawn == [(False, False), (True, True)]
    assert not window.paused


@pytest.mark.parametrize("how", ["escape", "quit"])
def test_once_closed_nothing_more_is_drawn(window, how):
    assert show(window) == [False]
    if how == "escape":
        press(window, "escape")
    else:
        window._pygame.event.post(window._pygame.event.Event(window._pygame.QUIT))
    show(window)
    assert window.closed
    assert show(window) == []


def test_without_a_gamepad_there_is_none(window):
    show(window)
    assert window.pad() is None


def test_a_gamepad_is_read_as_it_is_pushed_and_may_be_plugged_in_late(window):
    show(window)
    assert window.pad() is None
    with virtual_gamepad() as gamepad:
        show(window)
        assert window.pad() == pytest.approx((0.0, 0.0, 0.0), abs=1e-4)
        gamepad.push(stick=-1.0, right_trigger=0.75)
        show(window)
        assert window.pad() == pytest.approx((-1.0, 0.75, 0.0), abs=1e-4)
        gamepad.push(stick=0.5, right_trigger=0.0, left_trigger=1.0)
        show(window)
        assert window.pad() == pytest.approx((0.5, 0.0, 1.0), abs=1e-4)
    show(window)
    assert window.pad() is None
