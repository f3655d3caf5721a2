"""Traffic is not over-polite, and lights matter: what the expert scores without eyes for them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

from agents import load_agent
from di_envs.town.lanes import LightState, SignalKind
from di_envs.world.state import EventKind
from di_envs.world.world import Event, WorldView


def drive(agent_name: str, route: int, look: Callable[[WorldView], None]) -> list[Event]:
    """Drives a route of town05_long, without scenarios, to its end and returns its events."""
    env: Any = gymnasium.make(
        "DriveInsight-Town05Long-v1", observations=("prompt",), scenarios="none"
    ).unwrapped
    agent = load_agent(agent_name)
    observation, _ = env.reset(seed=route, options={"route": route})
    memory = agent.start(env.plan, route)
    events: list[Event] = []
    ended = False
    while not ended:
        control, memory = agent.act({**observation, "world": env.view}, memory)
        observation, _, terminated, truncated, info = env.step(control)
        events += info["events"]
        ended = terminated or truncated
        look(env.view)
    env.close()
    return events


class RedsMet:
    """Notes each light that is red while the ego's body is over its stop line, or just before."""

    def __init__(self) -> None:
        self.signals: list[int] = []
        self._now = -1

    def __call__(self, view: WorldView) -> None:
        state, lanes, signals = view.state, view.town.lanes, view.town.signals
        lane = int(state.lane[0])
        line = int(lanes.stop_line[lane])
        room = lanes.length_m[lane] - state.lane_m[0] - state.half_length[0]
        if line < 0 or room > 3.0:
            self._now = -1 if line >= 0 else self._now
            return
        signal = int(signals.stop_signal[line])
        if signal != self._now and signals.kind[signal] == SignalKind.LIGHT:
            if state.light[signal] == LightState.RED:
                self._now = signal
                self.signals.append(signal)


def test_an_expert_that_ignores_the_others_collides_with_many() -> None:
    factors = {EventKind.COLLISION_VEHICLE: 0.6, EventKind.COLLISION_WALKER: 0.5}
    scores = []
    for route in (3, 7, 8):
        events = drive("expert-blind", route, lambda view: None)
        scores.append(100.0 * np.prod([factors.get(event.kind, 1.0) for event in events]))
    print("driving scores at most", scores)
    assert np.mean(scores) <= 60.0


def test_an_expert_that_ignores_lights_runs_the_reds_that_it_meets() -> None:
    met = ran = 0
    for route in (0, 6, 8):
        reds = RedsMet()
        events = drive("expert-redrunner", route, reds)
        run = [event.other for event in events if event.kind == EventKind.RED_LIGHT]
        met += len(reds.signals) + len(set(run) - set(reds.signals))
        ran += len(run)
    print(f"{ran} of {met} reds run")
    assert met >= 10
    assert ran >= 0.7 * met
