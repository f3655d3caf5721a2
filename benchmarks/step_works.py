"""The works that `step_rate.py` times: a drive replayed, crowds without an ego, worlds, sensors.

Run as a script it does them on demand, in a process of its own: so two checkouts can take turns.
It imports only what versions of long ago have too.
"""

from __future__ import annotations

import argparse
import functools
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import di_envs
from agents import load_agent
from di_envs.route_env import RouteEnv
from di_envs.town.loading import load_town
from di_envs.town.town import Town
from di_envs.vector_env import RouteVectorEnv
from di_envs.world.state import TICK_S
from di_envs.world.world import World, WorldConfig

VEHICLES, WALKERS = 120, 60
# (vehicles, walkers): first more and more vehicles, then what vehicles and walkers cost alone
GROWTH = ((30, 60), (60, 60), (120, 60), (240, 60), (120, 0), (240, 0), (0, 60), (0, 120))
SEED = 0
WARM_UP_S = 30.0  # of traffic, from a standing start, before anything is timed
DRIVE_S = 60.0  # of a drive that is timed
CROWD_TICKS = 600
# Steps a round, by how many worlds with an ego that stands are stepped in one thread; 1 is a single
# environment
STANDING = {1: 240, 16: 30, 64: 10}
# Looks a round of each of `PLACES` vehicles, by the rig of cameras and the weather
LOOKS = {
    "small ClearNoon": 6,
    "small HardRainNoon": 6,
    "small ClearNight": 6,
    "rl ClearNoon": 30,
    "paper ClearNoon": 1,
}
PLACES = 12
STAND = np.array([0.0, 0.0, 1.0], np.float32)

# How many things a work does, and what does them
Work = tuple[int, Callable[[], Any]]


def record_drive(env: RouteEnv, seconds: float) -> list[np.ndarray]:
    """The expert's controls on the first route: to be replayed, bit for bit, without its cost."""
    agent = load_agent("expert")
    observation, _ = env.reset(seed=SEED, options={"route": 0})
    memory = agent.start(env.plan, SEED)
    controls: list[np.ndarray] = []
    while len(controls) * env.config.control_dt_s < seconds:
        control, memory = agent.act({**observation, "world": env.view}, memory)
        observation, _, terminated, truncated, _ = env.step(control)
        if terminated or truncated:
            break
        controls.append(control)
    return controls


def drive_works(env: RouteEnv) -> dict[str, Work]:
    """World ticks (`world`) and environment steps (`env`) along a drive of the expert."""
    controls = record_drive(env, WARM_UP_S + DRIVE_S)
    warm = round(WARM_UP_S / env.config.control_dt_s)
    env.reset(seed=SEED, options={"route": 0})
    for control in controls[:warm]:
        env.step(control)
    snapshot, timed = env.save_state(), controls[warm:]
    doubles = [control[None].astype(np.float64) for control in timed]
    ticks = env.config.control_ticks

    def step() -> None:
        env.restore_state(snapshot)
        for control in timed:
            env.step(control)

    def advance() -> None:
        env.restore_state(snapshot)
        for control in doubles:
            env.world.advance(control, ticks)

    return {"world": (len(timed) * ticks, advance), "env": (len(timed), step)}


def prompt_env() -> RouteEnv:
    """The environment whose steps are timed."""
    return RouteEnv(
        suite="town05_long", observations=("prompt",), traffic=VEHICLES, walkers=WALKERS
    )


def crowd(town: Town, vehicles: int, walkers: int) -> Work:
    """Drives a world on by some ticks from the same warm state, again and again."""
    none = np.zeros((0, 3))
    world = World(town, WorldConfig(vehicles=vehicles, walkers=walkers))
    world.reset(SEED, ())
    world.advance(none, round(WARM_UP_S / TICK_S))
    snapshot = world.save()

    def work() -> None:
        world.restore(snapshot)
        world.advance(none, CROWD_TICKS)

    return CROWD_TICKS, work


def growth_works() -> dict[str, Work]:
    """The crowds of `GROWTH`, by `vehicles | walkers`."""
    town = load_town("town05")
    return {
        f"{vehicles} | {walkers}": crowd(town, vehicles, walkers) for vehicles, walkers in GROWTH
    }


def standing_works() -> dict[str, Work]:
    """Worlds with an ego that stands, by their number."""
    return {str(worlds): standing(worlds, steps) for worlds, steps in STANDING.items()}


def standing(worlds: int, steps: int) -> Work:
    """Steps so many worlds so often; they go on from round to round, one alone begins anew."""
    made: Any = RouteEnv if worlds == 1 else functools.partial(RouteVectorEnv, worlds, threads=1)
    env = made(suite="town05_long", observations=("prompt",), traffic=VEHICLES, walkers=WALKERS)
    env.reset(seed=SEED)
    snapshot = env.save_state() if worlds == 1 else None
    action = STAND if worlds == 1 else np.tile(STAND, (worlds, 1))

    def work() -> None:
        if snapshot is not None:
            env.restore_state(snapshot)
        for _ in range(steps):
            env.step(action)

    return worlds * steps, work


def look_works() -> dict[str, Work]:
    """Cameras' looks from the places of vehicles in turn, in town among others."""
    from di_envs.sensors.camera.cameras import CameraRig
    from di_envs.sensors.camera.config import RIGS
    from di_envs.sensors.weather import weather_of

    town = load_town("town05")
    world = World(town, WorldConfig(vehicles=VEHICLES, walkers=WALKERS))
    world.reset(SEED, ())
    world.advance(np.zeros((0, 3)), round(WARM_UP_S / TICK_S))

    def looks(name: str, count: int) -> Work:
        rig, weather = name.split()
        sensors = [
            CameraRig(town, RIGS[rig], weather_of(weather), ego)
            for ego in range(0, VEHICLES, VEHICLES // PLACES)
        ]

        def work() -> None:
            for sensor in sensors:
                sensor.start(world.view)
                for _ in range(count):
                    sensor.observe()

        return count * len(sensors), work

    return {name: looks(name, count) for name, count in LOOKS.items()}


# What makes works, by the names of those that it makes
MAKERS: dict[tuple[str, ...], Callable[[], dict[str, Work]]] = {
    ("world", "env"): lambda: drive_works(prompt_env()),
    tuple(f"{vehicles} | {walkers}" for vehicles, walkers in GROWTH): growth_works,
    tuple(str(worlds) for worlds in STANDING): standing_works,
    tuple(LOOKS): look_works,
}


def main() -> None:
    """Does one round of each work named on the standard input, and says its processor time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="the checkout that must be the one imported")
    folder = parser.parse_args().folder
    here = Path(di_envs.__file__).resolve().parents[1]
    if here != folder.resolve():
        sys.exit(f"expected di_envs of {folder}, but that of {here} was imported")
    works: dict[str, Work] = {}
    for line in sys.stdin:
        name = line.strip()
        if name not in works:
            works |= next(make() for names, make in MAKERS.items() if name in names)
        count, work = works[name]
        begin = time.process_time()
        work()
        print((time.process_time() - begin) / count, flush=True)


if __name__ == "__main__":
    main()
