"""Which moments of two futures are worth a picture, and how each looks from above.

The first infraction that only one of them has is what a branch is about: it is shown at its very
tick, which may lie within a decision, and so are the moments around it in both futures.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from di_envs.course import load_course
from di_envs.drawing.view import Renderer
from di_envs.edits.world import MoveActor, RemoveActor
from di_envs.rules import rules_named
from di_envs.world.kinds import ActorKind
from di_envs.world.state import TICK_S
from di_envs.world.struck import footprint
from di_envs.world.world import WorldView
from leaderboard.records.record import EventRecord, RouteRecord, RunRecord
from leaderboard.replaying.branch import Branch
from leaderboard.replaying.replay import replay, replay_env

AFTER_S = (0.0, 2.0, 4.0, 8.0)  # moments after the branch, where no infraction tells them apart
AROUND_S = (-1.0, 0.0, 2.0)  # moments around the infraction that does


@dataclass(frozen=True, kw_only=True)
class Body:
    """Where an actor that was edited is: metres from the ego, and its outline."""

    x_m: float
    y_m: float
    yaw_rad: float
    half_length_m: float
    half_width_m: float


@dataclass(frozen=True, kw_only=True)
class Moment:
    """A moment of a future.

    Attributes:
        time_s: Game time.
        streets: The map around the ego, see `Renderer.map`.
        place: (x, y) of the ego, world frame.
        bodies: By id, the edited actors that there are.
    """

    time_s: float
    streets: Any
    place: tuple[float, float]
    bodies: dict[int, Body]


def telling_event(run: RunRecord, branch: Branch) -> EventRecord | None:
    """The first infraction after the branch that one future has and the other has not."""
    kinds = rules_named(run.rules).infractions
    futures = [
        {event for event in record.events if event.kind in kinds and event.time_s >= branch.at_s}
        for record in (branch.recorded, branch.edited)
    ]
    return min(futures[0] ^ futures[1], key=lambda event: event.time_s, default=None)


def shown_times(run: RunRecord, branch: Branch) -> tuple[float, ...]:
    """Game times that are shown, ascending: the branch first."""
    event = telling_event(run, branch)
    if event is None:
        return tuple(branch.at_s + after_s for after_s in AFTER_S)
    around = {event.time_s + after_s for after_s in AROUND_S}
    later = sorted(time_s for time_s in around if time_s > branch.at_s + TICK_S)
    return (branch.at_s, *later)


def edited_actors(branch: Branch) -> tuple[int, ...]:
    """Ids of the actors that were removed or moved."""
    edits = (edit for edit in branch.edits if isinstance(edit, RemoveActor | MoveActor))
    return tuple(dict.fromkeys(edit.actor for edit in edits))


def moments_of(
    run: RunRecord, record: RouteRecord, times_s: Sequence[float], actors: Sequence[int]
) -> Iterator[Moment]:
    """A future at some game times, or at its end where it is over before.

    Args:
        run: The run that the record is of.
        record: The future.
        times_s: Game times, ascending.
        actors: Ids of those whose places are wanted.

    Raises:
        ReplayError: If it cannot be replayed here.
    """
    env = replay_env(run)
    renderer = Renderer(load_course(env.config.changes()))
    controls, dt_s = record.control_array(), env.config.control_dt_s
    left = list(times_s)

    def seen(time_s: float) -> Moment:
        return Moment(
            time_s=time_s,
            streets=renderer.map(env.view),
            place=_place(env.view),
            bodies=_bodies(env.view, actors),
        )

    for step in replay(run, record, env=env):
        over = step.over or step.decision == record.steps
        while left and (over or left[0] < step.time_s + dt_s - TICK_S / 2):
            ticks = 0 if over else round((left.pop(0) - step.time_s) / TICK_S)
            if over:
                left.pop(0)
            if ticks <= 0:
                yield seen(step.time_s)
                continue
            here = env.save_state()
            env.hold(controls[step.decision])
            env.world.run(ticks)
            yield seen(step.time_s + ticks * TICK_S)
            env.restore_state(here)


def _place(view: WorldView) -> tuple[float, float]:
    return float(view.state.x[view.ego]), float(view.state.y[view.ego])


def _bodies(view: WorldView, actors: Sequence[int]) -> dict[int, Body]:
    state, (x, y) = view.state, _place(view)
    found = {}
    for actor in actors:
        if state.kind[actor] == ActorKind.ABSENT:
            continue
        half_length, half_width = footprint(state, actor)
        found[actor] = Body(
            x_m=float(state.x[actor]) - x,
            y_m=float(state.y[actor]) - y,
            yaw_rad=float(state.yaw[actor]),
            half_length_m=float(half_length),
            half_width_m=float(half_width),
        )
    return found
