"""A person drives: real keys in a real window (SDL's dummy driver), scored by `evaluate`'s path."""

from __future__ import annotations

import numpy as np
import pytest
from rich.console import Console

from di_envs.suites import load_suite
from leaderboard.commands.cli import EXIT_USAGE, main
from leaderboard.records.results import read_run
from leaderboard.replaying.retracing import RetraceError, retrace
from leaderboard.replaying.verify import verify_run
from leaderboard.replaying.watching import watch
from leaderboard.running.jobs import RunSpec
from leaderboard.running.playing import PlayEngine
from leaderboard.running.runner import evaluate
from tests.di_envs.drawing.virtual_gamepad import virtual_gamepad

SUITE = load_suite("toy")
ROUTE = SUITE.specs()[0].route_id
OPTIONS = {"suite": "toy", "traffic": 2, "walkers": 1, "route_ids": (ROUTE,)}


@pytest.fixture(autouse=True)
def display(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


def press(*names):
    import pygame

    for name in names:
        key = pygame.key.key_code(name)
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key, unicode=name))


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """Throttle and the wheel to the right for ten decisions; then the person has had enough."""
    folder = tmp_path_factory.mktemp("played") / "run"
    asked = iter(range(1000))
    with pytest.MonkeyPatch.context() as patch, open(folder.parent / "said", "w") as said:
        patch.setenv("SDL_VIDEODRIVER", "dummy")
        console = Console(file=said)
        spec = RunSpec(agent="human:keyboard", options=OPTIONS)
        engine = PlayEngine(spec, console, stopped=lambda: next(asked) >= 10)
        press("up", "right", *["+"] * 4)
        evaluate(spec, (0,), suite=SUITE, folder=folder, engine=engine, console=console)
        engine.close()
    return folder


def test_what_was_pressed_is_what_was_driven_and_scored(played):
    run = read_run(played)
    (record,) = run.routes
    assert run.agent == "human:keyboard"
    assert run.track == "PRIVILEGED"
    assert record.steps == 10
    assert record.status == "Failed - Agent crashed"
    assert "given up before the route was over" in record.reason
    controls = record.control_array()
    assert controls[:5, 0] == pytest.approx([0.16, 0.32, 0.48, 0.64, 0.8])  # 1.6 a second
    assert controls[:5, 1] == pytest.approx([0.12, 0.24, 0.36, 0.48, 0.6])  # 1.2 a second
    assert np.all(controls[:, 2] == 0.0)
    assert record.trace[-1][1:3] != record.trace[0][1:3]


def test_a_gamepad_drives_by_its_stick_and_triggers(tmp_path):
    import pygame

    asked = iter(range(1000))
    pygame.display.init()
    with virtual_gamepad() as gamepad, open(tmp_path / "said", "w") as said:
        gamepad.push(stick=-1.0, right_trigger=0.5, left_trigger=0.25)
        console = Console(file=said)
        spec = RunSpec(agent="human:gamepad", options=OPTIONS)
        engine = PlayEngine(spec, console, stopped=lambda: next(asked) >= 3)
        press(*["+"] * 4)
        run = evaluate(
            spec, (0,), suite=SUITE, folder=tmp_path / "run", engine=engine, console=console
        )
        engine.close()
    (record,) = run.routes
    assert record.control_array() == pytest.approx(np.array([[0.5, -1.0, 0.25]] * 3), abs=1e-4)


def test_the_score_stands_when_its_controls_are_driven_again(played):
    assert verify_run(read_run(played), played).stands


def test_nobody_can_be_asked_again_what_they_did(played):
    run = read_run(played)
    with pytest.raises(RetraceError, match="driveinsight watch"):
        list(retrace(run, run.routes[0]))


def test_a_recorded_drive_is_watched_until_the_window_is_closed(played, monkeypatch):
    from di_envs.drawing import window

    run = read_run(played)
    shown = []
    paint = window.Window._paint

    def painted(one, frame):
        paint(one, frame)
        shown.append(frame.shape)
        if len(shown) == 2:
            press("escape")

    monkeypatch.setattr(window.Window, "_paint", painted)
    assert watch(run, run.routes[0], at_s=0.7) == pytest.approx(0.8)  # the second that is shown
    assert shown == [(640, 960, 3)] * 2


def test_without_a_display_or_a_gamepad_the_commands_say_what_to_do(
    played, monkeypatch, capsys, tmp_path
):
    play = ["play", "--suite", "toy", "--traffic", "2", "--walkers", "1", "--route", ROUTE]
    out = ["--output", str(tmp_path / "run")]
    assert main([*play, *out, "--gamepad"]) == EXIT_USAGE
    assert "plug one in, or leave out --gamepad" in capsys.readouterr().err
    monkeypatch.setenv("SDL_VIDEODRIVER", "x11")
    monkeypatch.setenv("DISPLAY", ":97")
    for command in ([*play, *out], ["watch", str(played)]):
        assert main(command) == EXIT_USAGE
        assert "There is no display to open a window on" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
