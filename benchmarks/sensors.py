"""How long the cameras of each shipped rig take in town among 120 vehicles, on one core.

    python benchmarks/sensors.py

Prints the median over places and asserts nothing. Times are of the processor, not of the clock on
the wall, so that other work on the machine disturbs them less.
"""

from __future__ import annotations

import argparse
import statistics
import time

import numpy as np
from rich.console import Console
from rich.table import Table

from di_envs.kernels import cpu_capability
from di_envs.sensors.camera import CameraRig
from di_envs.sensors.camera_config import RIGS, Rig
from di_envs.sensors.scene import scene_of
from di_envs.sensors.weather import weather_of
from di_envs.town.loading import load_town
from di_envs.world.world import World, WorldConfig

VEHICLES, WALKERS = 120, 60
WARM_UP_TICKS = 600  # of traffic, from a standing start
SEED = 0


def milliseconds(world: World, rig: Rig, weather: str, places: int, rounds: int) -> list[float]:
    """Medians over `rounds` at the places of some vehicles, each of which carries the rig."""
    medians = []
    for ego in range(0, VEHICLES, max(1, VEHICLES // places)):
        cameras = CameraRig(world.town, rig, weather_of(weather), ego)
        cameras.start(world.view)
        cameras.observe()
        times = []
        for _ in range(rounds):
            begin = time.process_time()
            cameras.observe()
            times.append(1e3 * (time.process_time() - begin))
        medians.append(statistics.median(times))
    return medians


def main() -> None:
    """Measures each rig in a few weathers and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--places", type=int, default=24, help="vehicles that carry the rig in turn"
    )
    parser.add_argument("--rounds", type=int, default=5, help="images at each place")
    options = parser.parse_args()
    town = load_town("town05")
    begin = time.process_time()
    scene_of(town)
    built_s = time.process_time() - begin
    world = World(town, WorldConfig(vehicles=VEHICLES, walkers=WALKERS))
    world.reset(SEED, [])
    world.advance(np.zeros((0, 3)), WARM_UP_TICKS)
    table = Table("rig", "weather", "median ms", "worst place ms")
    for name in ("small", "paper", "rl"):
        for weather in ("ClearNoon", "HardRainNoon", "ClearNight"):
            times = milliseconds(world, RIGS[name], weather, options.places, options.rounds)
            worst = f"{max(times):.2f}"
            table.add_row(name, weather, f"{statistics.median(times):.2f}", worst)
    console = Console()
    console.print(f"{cpu_capability()}; scene built in {built_s:.1f} s")
    console.print(table)


if __name__ == "__main__":
    main()
