"""A recorded drive in the window: what happened, as it happened, from any moment on."""

from __future__ import annotations

from collections.abc import Callable

from di_envs.course import load_course
from di_envs.drawing.screen import Screen
from di_envs.world.world import Event
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.replay import ReplayStep, replay, replay_env


def watch(
    run: RunRecord,
    record: RouteRecord,
    *,
    at_s: float = 0.0,
    on_event: Callable[[Event], None] = lambda event: None,
) -> float:
    """Replays a route in the window until it is over and the window is closed.

    Args:
        run: The run that the record is of.
        record: The route.
        at_s: Game time from which on it is shown.
        on_event: Told every event, those before that time too.

    Returns:
        The game time that was shown last.

    Raises:
        RuntimeError: If there is no display.
        ReplayError: If the route cannot be replayed here.
    """
    env = replay_env(run, rules=run.rules)
    screen = Screen(load_course(env.config.changes()), "human", camera=True)
    assert screen.window is not None
    step = None
    try:
        for step in replay(run, record, env=env):
            for event in step.events:
                on_event(event)
            if step.time_s >= at_s:
                _show(screen, step)
            if screen.window.closed:
                break
        assert step is not None  # a replay has a start
        if not screen.window.closed:
            screen.window.paused = True  # the end stays, until P or Esc
            _show(screen, step)
        return step.time_s
    finally:
        screen.close()
        env.close()


def _show(screen: Screen, step: ReplayStep) -> None:
    screen.draw(step.view, step.view.ego, step.observation)
