"""The cycle of lights: arms take turns of 10 s green, 3 s yellow and 2 s red, the rest stay red."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from di_envs.town.lanes import LightState, SignalKind
from di_envs.town.loading import load_town
from di_envs.world.lights import GREEN_TICKS, RED_TICKS, TURN_TICKS, YELLOW_TICKS
from di_envs.world.state import TICK_S
from di_envs.world.world import World, WorldConfig

NONE = np.zeros((0, 3))
LETTERS = {LightState.GREEN: "G", LightState.YELLOW: "Y", LightState.RED: "R"}


def empty_world(town: str = "toy", seed: int = 0) -> World:
    world = World(load_town(town), WorldConfig(vehicles=0, walkers=0))
    world.reset(seed, ())
    return world


def shown(world: World, ticks: int) -> np.ndarray:
    """(ticks, S) what each head shows after each tick."""
    rows = []
    for _ in range(ticks):
        world.advance(NONE)
        rows.append(world.view.state.light.copy())
    return np.array(rows)


def runs(column: np.ndarray) -> list[tuple[str, int]]:
    """Each colour shown and for how many ticks, the cut-off first and last left out."""
    edges = np.flatnonzero(np.diff(column)) + 1
    pieces = np.split(column, edges)[1:-1]
    return [(LETTERS[LightState(piece[0])], piece.size) for piece in pieces]


def test_a_turn_takes_ten_three_and_two_seconds():
    assert [ticks * TICK_S for ticks in (GREEN_TICKS, YELLOW_TICKS, RED_TICKS)] == [10.0, 3.0, 2.0]
    assert TURN_TICKS * TICK_S == 15.0


def test_each_of_three_arms_shows_green_ten_yellow_three_and_red_thirty_two_seconds():
    """Junction 1 of the toy town has three lights: a cycle of 45 s."""
    light = shown(empty_world(), 2 * 3 * TURN_TICKS + TURN_TICKS)
    for signal in range(3):
        lengths = dict(runs(light[:, signal]))
        assert {name: ticks * TICK_S for name, ticks in lengths.items()} == {
            "G": 10.0,
            "Y": 3.0,
            "R": 32.0,
        }


def test_green_turns_yellow_yellow_red_and_red_green():
    letters = "".join(name for name, _ in runs(shown(empty_world(), 5 * TURN_TICKS)[:, 0]))
    assert letters in "GYRGYRGYRGYR"


@pytest.mark.parametrize("town", ["toy", "town05"])
def test_one_arm_at_a_time_has_the_junction_and_all_are_red_for_two_seconds_between(town):
    world = empty_world(town)
    signals = world.town.signals
    light = shown(world, 4 * TURN_TICKS)
    for junction in np.flatnonzero(signals.groups):
        here = (signals.kind == SignalKind.LIGHT) & (signals.junction == junction)
        open_groups = [
            set(signals.group[here][row != LightState.RED].tolist()) for row in light[:, here]
        ]
        assert max(len(groups) for groups in open_groups) == 1
        closed = sum(not groups for groups in open_groups)
        assert closed * TICK_S == pytest.approx(4 * 2.0)
        turns = [groups for groups in open_groups if groups]
        order = [min(a) for a, b in pairwise(turns) if a != b]
        count = int(signals.groups[junction])
        assert all((b - a) % count == 1 for a, b in pairwise(order))


def test_signs_show_nothing():
    world = empty_world()
    signs = world.town.signals.kind != SignalKind.LIGHT
    assert signs.sum() == 1
    assert not shown(world, 400)[:, signs].any()


def test_the_lights_are_right_before_the_first_tick():
    world = empty_world()
    at_start = world.view.state.light.copy()
    assert sorted(at_start[:3].tolist())[1:] == [LightState.RED] * 2
    ticks_left = TURN_TICKS - int(world.view.state.phase_ticks[0])
    group = int(world.view.state.phase_group[0])
    shown(world, ticks_left)
    assert int(world.view.state.phase_group[0]) == (group + 1) % 3
    assert int(world.view.state.phase_ticks[0]) == 0


def test_the_phase_comes_from_the_seed_each_junction_for_itself():
    """Over 200 seeds every group begins about a third of the time, at all times of its turn."""
    world, starts = empty_world(), []
    for seed in [*range(200), 0]:
        world.reset(seed, ())
        state = world.view.state
        starts.append((int(state.phase_group[0]), int(state.phase_ticks[0])))
    assert starts.pop() == starts[0]
    groups, ticks = np.array(starts).T
    # four standard deviations of a binomial of 200 draws: 4 sqrt(200 / 3 * 2 / 3) = 27
    assert (np.abs(np.bincount(groups, minlength=3) - 200 / 3) < 27).all()
    assert ticks.min() >= 0
    assert ticks.max() < TURN_TICKS
    assert np.abs(ticks.mean() - (TURN_TICKS - 1) / 2) < 4 * TURN_TICKS / np.sqrt(12 * 200)
    town = empty_world("town05")
    phases = town.view.state.phase_ticks[town.town.signals.groups > 0]
    assert np.unique(phases).size > 10  # of 15 junctions
