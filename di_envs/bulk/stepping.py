"""The kernel that steps many worlds: advances each, looks at it, and counts what it has come to.

What the rules count is rare. The kernel does the arithmetic of a step without any of it, that of
`reward_terms` and of `Course.info`, and marks the other steps, which Python works out as it does
those of a single environment.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from di_envs.bulk.fetching import fetch_traffic, fetch_walkers
from di_envs.numerics.arrays import Float64, Int8, Int32
from di_envs.numerics.bundle_rows import BundleRow
from di_envs.numerics.bundles import by_reference
from di_envs.numerics.counters import take_next
from di_envs.numerics.kernels import kernel
from di_envs.numerics.machine_code import MachineCode, call
from di_envs.observer import ObservationParts
from di_envs.world.state import CHECKPOINTS, EVENT_KINDS, TICK_S, State
from di_envs.world.step import Scenery, Scratch

# Rows of `Tally.numbers`, then one a term of the reward behind the first two of them
COMPLETION, PENALTY, SCORE, TIME, JUNCTION, PROGRESS, OUTSIDE = range(7)

_EGO = 0


@by_reference
class WorldParts(NamedTuple):
    """One world with one ego, as the kernel takes it."""

    state: State
    scenery: Scenery
    sight: ObservationParts
    vehicle_end: int  # first actor id behind the vehicles
    walker_end: int  # first actor id behind the walkers
    length_m: float  # of the route
    junction_m: Float64  # (R,) of the route's points, to the next one in a junction
    event_rows: Float64  # (N, COLUMNS) written


@by_reference
class Before(NamedTuple):
    """Where the egos of N worlds stood before a step: named as in `State`, for `standing_of`."""

    route_done_m: Float64  # (N,)
    outside_m: Float64  # (N,)
    outside_done_m: Float64  # (N,)
    counts: Int32  # (N, EVENT_KINDS)
    pace_share: Float64  # (N, CHECKPOINTS)


@by_reference
class Tally(NamedTuple):
    """What the kernel is told of N worlds, and what it says of their steps."""

    left: Int8  # (N,) 1 for a world that is left as it is
    block: Int32  # (1,) the first block of worlds that no thread has taken yet
    controls: Float64  # (N, 3) throttle, steer, brake
    # of the last step that Python worked out: nothing that costs has happened as long as they hold
    counts: Int32  # (N, EVENT_KINDS) events
    pace: Float64  # (N, CHECKPOINTS) shares of the traffic's pace
    penalty: Float64  # (N,) the infraction score
    before: Before  # written, as is the rest: what came of the step
    events: Int32  # (N,) rows in use
    counted: Int8  # (N,) 1 where the rules may have counted something: Python works it out
    reward: Float64  # (N,)
    numbers: Float64  # (C, N) of `info`


def make_tally(worlds: int, terms: int) -> Tally:
    """Arrays for so many worlds, and rewards of so many terms; nothing is known yet."""
    return Tally(
        left=np.zeros(worlds, np.int8),
        block=np.zeros(1, np.int32),
        controls=np.zeros((worlds, 3)),
        counts=np.full((worlds, EVENT_KINDS), -1, np.int32),
        pace=np.zeros((worlds, CHECKPOINTS)),
        penalty=np.zeros(worlds),
        before=Before(
            route_done_m=np.zeros(worlds),
            outside_m=np.zeros(worlds),
            outside_done_m=np.zeros(worlds),
            counts=np.zeros((worlds, EVENT_KINDS), np.int32),
            pace_share=np.zeros((worlds, CHECKPOINTS)),
        ),
        events=np.zeros(worlds, np.int32),
        counted=np.zeros(worlds, np.int8),
        reward=np.zeros(worlds),
        numbers=np.zeros((PROGRESS + terms, worlds)),
    )


@kernel
def step_worlds(
    advance: MachineCode,
    look: MachineCode,
    worlds: BundleRow[WorldParts],
    scratch: Scratch,
    tally: Tally,
    size: int,
    ticks: int,
    with_prompt: bool,
    with_inertial: bool,
) -> None:
    """Steps worlds that are not left out, a block of them after the other, until all are taken.

    Args:
        advance: Of `di_envs.world.step.advance`.
        look: Of `di_envs.observer.fill_observation`.
        worlds: All of them.
        scratch: Working memory, which no other thread uses meanwhile.
        tally: Of all of them; only rows of worlds that this call takes are read and written.
        size: Worlds of a block.
        ticks: For how many ticks the controls are held.
        with_prompt: Whether prompts are written.
        with_inertial: Whether the inertial sensors are.
    """
    count = tally.left.size
    while True:
        first = size * take_next(tally.block)
        if first >= count:
            return
        for index in range(first, min(first + size, count)):
            if tally.left[index]:
                continue
            world = worlds[index]
            state = world.state
            if index + 1 < count:
                _fetch(worlds[index + 1])
            _note_before(tally.before, state, index)
            state.throttle[_EGO] = tally.controls[index, 0]
            state.steer[_EGO] = tally.controls[index, 1]
            state.brake[_EGO] = tally.controls[index, 2]
            tally.events[index] = call(
                advance,
                state,
                world.scenery,
                scratch,
                world.vehicle_end,
                world.walker_end,
                ticks,
                world.event_rows,
            )
            call(look, world.sight, _EGO, with_prompt, with_inertial)
            _count(tally, world, index)


@kernel
def _fetch(world: WorldParts) -> None:
    """Asks for what the world that comes next will read."""
    state, scenery = world.state, world.scenery
    fetch_traffic(state, scenery.lanes, scenery.tables, world.vehicle_end)
    fetch_walkers(state, scenery.walk, world.vehicle_end, world.walker_end)


@kernel
def _note_before(before: Before, state: State, index: int) -> None:
    """Notes where a world's ego stands."""
    before.route_done_m[index] = state.route_done_m[_EGO]
    before.outside_m[index] = state.outside_m[_EGO]
    before.outside_done_m[index] = state.outside_done_m[_EGO]
    before.counts[index] = state.counts[_EGO]
    before.pace_share[index] = state.pace_share[_EGO]


@kernel
def _count(tally: Tally, world: WorldParts, index: int) -> None:
    """Writes a step's reward and numbers, unless the rules may have counted something in it."""
    state = world.state
    tally.counted[index] = not _all_is_known(tally, state, index)
    if tally.counted[index]:
        return
    done_m, penalty = state.route_done_m[_EGO], tally.penalty[index]
    before = tally.before
    done_before = before.route_done_m[index]
    inside_m = _inside_metres(done_m, state.outside_m[_EGO], state.outside_done_m[_EGO])
    inside_before = _inside_metres(
        done_before, before.outside_m[index], before.outside_done_m[index]
    )
    progress_m = done_m - done_before
    numbers = tally.numbers
    numbers[COMPLETION, index] = 100.0 * done_m / world.length_m
    numbers[PENALTY, index] = penalty
    numbers[SCORE, index] = 100.0 * (inside_m * penalty) / world.length_m
    numbers[TIME, index] = state.tick[()] * TICK_S
    numbers[JUNCTION, index] = world.junction_m[state.route_index[_EGO]]
    numbers[PROGRESS, index] = progress_m * penalty
    numbers[OUTSIDE, index] = (inside_m - inside_before - progress_m) * penalty
    numbers[OUTSIDE + 1 :, index] = 0.0
    tally.reward[index] = 0.0 + numbers[PROGRESS, index] + numbers[OUTSIDE, index]


@kernel
def _all_is_known(tally: Tally, state: State, index: int) -> bool:
    """Whether a world's events are those that Python knows of, before the step and after it."""
    if state.finished[_EGO] != 0:
        return False
    for kind in range(EVENT_KINDS):
        known = tally.counts[index, kind]
        if tally.before.counts[index, kind] != known or state.counts[_EGO, kind] != known:
            return False
    for at in range(CHECKPOINTS):
        share = tally.pace[index, at]
        if tally.before.pace_share[index, at] != share or state.pace_share[_EGO, at] != share:
            return False
    return True


@kernel
def _inside_metres(done_m: float, outside_m: float, counted_m: float) -> float:
    """As `di_envs.reward.inside_metres` of a standing."""
    share = min(outside_m / counted_m, 1.0) if outside_m > 0.0 else 0.0
    return done_m * (1.0 - share)
