"""Lets traffic and walkers run among themselves, and says who collided and who stood for long.

    python benchmarks/traffic_soak.py                                    # the shipped town
    python benchmarks/traffic_soak.py town05 Town04.xodr --vehicles 120 --minutes 20 --seeds 3

Prints and asserts nothing. Who stands at a red light may: a stand counts from the last look at
which the next light on the way was not green.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import numpy as np

from di_envs.numerics.geometry import boxes_overlap
from di_envs.town.lanes import LightState, SignalKind
from di_envs.town.loading import load_town
from di_envs.town.town import Town
from di_envs.world.state import TICK_S, ActorKind, State
from di_envs.world.world import World, WorldConfig

LOOK_TICKS = 10
LONG_S = 120.0
REACH_M = 12.0  # no two vehicles touch whose middles are further apart
AWAY_M = 3.0  # who has not come so far from a place in `LONG_S` is stuck there, if he walks


@dataclass(frozen=True, kw_only=True)
class Soaked:
    """What a soak found.

    Attributes:
        vehicles: How many drove, or waited to come back, at the end.
        collisions: How many pairs overlapped of which one is a vehicle, each counted once.
        longest_s: The longest stand without a red light.
        standing: Vehicles that stood longer than `LONG_S` without one.
        longest_with_reds_s: The longest stand, reds counted.
        stuck: Walkers who stayed longer than `LONG_S` within `AWAY_M` of a place.
        speed_mps: Mean speed over all that drove.
        wall_s: Wall time of all of it.
    """

    vehicles: int
    collisions: int
    longest_s: float
    standing: int
    longest_with_reds_s: float
    stuck: int
    speed_mps: float
    wall_s: float


def soak(town: Town, seed: int, vehicles: int, walkers: int, minutes: float) -> Soaked:
    """Runs a world without an ego for so long, and looks at it twice a second."""
    begin = time.perf_counter()
    world = World(town, WorldConfig(vehicles=vehicles, walkers=walkers))
    world.reset(seed, ())
    state, none = world.view.state, np.zeros((0, 3))
    pairs: set[tuple[int, int]] = set()
    standing: set[int] = set()
    stuck: set[int] = set()
    longest, with_reds, speeds = 0.0, 0.0, []
    red = np.zeros(vehicles)  # the tick at which each last waited for a light
    first, end = vehicles, vehicles + walkers
    anchor, anchored = np.full((walkers, 2), np.inf), np.zeros(walkers)
    for _ in range(round(minutes * 60.0 / TICK_S / LOOK_TICKS)):
        world.advance(none, LOOK_TICKS)
        here = np.flatnonzero(state.kind[:vehicles] != ActorKind.ABSENT)
        speeds.append(float(state.speed[here].mean()) if here.size else 0.0)
        people = first + np.flatnonzero(state.kind[first:end] == ActorKind.WALKER)
        pairs |= _touching(state, here, np.concatenate([here, people]))
        places = np.column_stack([state.x[first:end], state.y[first:end]])
        moved = np.hypot(*(places - anchor).T) > AWAY_M
        anchor[moved], anchored[moved] = places[moved], state.tick[()]
        stays = (state.tick[()] - anchored) * TICK_S > LONG_S
        stuck |= set(np.flatnonzero(stays[people - first]).tolist())
        tick, still = state.tick[()], state.still_ticks[:vehicles]
        for actor in here[still[here] > 0].tolist():
            if _waits_at_red(town, state, actor):
                red[actor] = tick
        stood = np.minimum(still, tick - red)[here] * TICK_S
        standing |= set(here[stood > LONG_S].tolist())
        longest = max(longest, float(stood.max(initial=0.0)))
        with_reds = max(with_reds, float(still[here].max(initial=0)) * TICK_S)
    present = (state.kind[:vehicles] != ActorKind.ABSENT) | (state.away[:vehicles] != 0)
    return Soaked(
        vehicles=int(present.sum()),
        collisions=len(pairs),
        longest_s=longest,
        standing=len(standing),
        longest_with_reds_s=with_reds,
        stuck=len(stuck),
        speed_mps=float(np.mean(speeds)),
        wall_s=time.perf_counter() - begin,
    )


def _touching(state: State, vehicles: np.ndarray, others: np.ndarray) -> set[tuple[int, int]]:
    away_x = state.x[vehicles][:, None] - state.x[others]
    away_y = state.y[vehicles][:, None] - state.y[others]
    near = np.hypot(away_x, away_y) < REACH_M
    near &= np.abs(state.z[vehicles][:, None] - state.z[others]) < 3.0
    near &= vehicles[:, None] < others
    found = set()
    for i, j in np.argwhere(near):
        pair = int(vehicles[i]), int(others[j])
        boxes = [
            (state.x[a], state.y[a], state.yaw[a], state.half_length[a], state.half_width[a])
            for a in pair
        ]
        if boxes_overlap(*boxes[0], *boxes[1]):
            found.add(pair)
    return found


def _waits_at_red(town: Town, state: State, actor: int) -> bool:
    """Whether the next stop line on a vehicle's path has a light that is not green."""
    for lane in state.path[actor].tolist():
        line = int(town.lanes.stop_line[lane]) if lane >= 0 else -1
        if line >= 0:
            signal = int(town.signals.stop_signal[line])
            light = town.signals.kind[signal] == SignalKind.LIGHT
            return bool(light and state.light[signal] != LightState.GREEN)
    return False


def main() -> None:
    """Soaks each town with each seed and prints a line for each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("towns", nargs="*", default=["town05"], help="shipped names or files")
    parser.add_argument("--signals", help="as for `driveinsight evaluate`")
    parser.add_argument("--vehicles", type=int, default=120)
    parser.add_argument("--walkers", type=int, default=60)
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--seeds", type=int, default=1)
    options = parser.parse_args()
    for name in options.towns:
        town = load_town(name, options.signals)
        for seed in range(options.seeds):
            found = soak(town, seed, options.vehicles, options.walkers, options.minutes)
            print(
                f"{town.name}, seed {seed}: {found.vehicles} vehicles, {found.collisions} pairs "
                f"collided, longest stand without a red {found.longest_s:.0f} s (with reds "
                f"{found.longest_with_reds_s:.0f}), {found.standing} "
                f"over {LONG_S:.0f} s, {found.stuck} walkers stuck, {found.speed_mps:.2f} m/s, "
                f"{found.wall_s:.0f} s"
            )


if __name__ == "__main__":
    main()
