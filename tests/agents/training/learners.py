"""Learners for the expert to correct: one that never moves, and one that soon gives up."""

from __future__ import annotations

from agents.base import Requirements, make_control


class Idle:
    """Holds the brake."""

    requires = Requirements()

    def start(self, plan, seed):
        return None

    def act(self, observation, memory):
        return make_control(0.0, 0.0, 1.0), memory

    def close(self):
        pass


class Timid(Idle):
    """Drives off, and leaves the road."""

    def act(self, observation, memory):
        return make_control(0.5, 0.02, 0.0), memory
