"""Poles of lights and stop signs as static bodies: who leaves the road can hit something."""

from __future__ import annotations

from di_envs.town.lanes import SignalKind, Signals
from di_envs.world.kinds import ActorKind
from di_envs.world.state import State

HALF_WIDTH_M = 0.15
LIGHT_HEIGHT_M = 5.0
SIGN_HEIGHT_M = 3.0


def place_poles(state: State, signals: Signals, first: int) -> None:
    """Puts a prop at the foot of each signal, in the slots from `first` on, for good."""
    poles = slice(first, first + signals.kind.size)
    state.kind[poles] = ActorKind.PROP
    for axis, place in zip((state.x, state.y, state.z, state.yaw), signals.pose.T, strict=True):
        axis[poles] = place
    state.half_length[poles] = state.half_width[poles] = HALF_WIDTH_M
    state.height[poles] = SIGN_HEIGHT_M
    state.height[poles][signals.kind == SignalKind.LIGHT] = LIGHT_HEIGHT_M
