"""How long shipped camera rigs and LiDARs take in town among 120 vehicles, on one core.

    python benchmarks/sensors.py

Prints the median over places and asserts nothing. Times are of the processor, not of the clock on
the wall, so that other work on the machine disturbs them less.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np
from rich.console import Console
from rich.table import Table

from di_envs.kernels import cpu_capability
from di_envs.sensors.camera import CameraRig
from di_envs.sensors.camera_config import RIGS
from di_envs.sensors.lidar import Lidar
from di_envs.sensors.lidar_config import LIDARS
from di_envs.sensors.scene import scene_of
from di_envs.sensors.weather import weather_of
from di_envs.town.loading import load_town
from di_envs.world.world import World, WorldConfig

VEHICLES, WALKERS = 120, 60
WARM_UP_TICKS = 600  # of traffic, from a standing start
SEED = 0


def milliseconds(
    world: World, sensor_of: Callable[[int], CameraRig | Lidar], places: int, rounds: int
) -> list[float]:
    """Medians over `rounds` at the places of some vehicles, each of which carries the sensor."""
    medians = []
    for ego in range(0, VEHICLES, max(1, VEHICLES // places)):
        sensor = sensor_of(ego)
        sensor.start(world.view)
        sensor.observe()
        times = []
        for _ in range(rounds):
            begin = time.process_time()
            sensor.observe()
            times.append(1e3 * (time.process_time() - begin))
        medians.append(statistics.median(times))
    return medians


def main() -> None:
    """Measures each rig in a few weathers, each LiDAR, and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--places", type=int, default=24, help="vehicles that carry the rig in turn"
    )
    parser.add_argument("--rounds", type=int, default=5, help="images or sweeps at each place")
    options = parser.parse_args()
    town = load_town("town05")
    begin = time.process_time()
    scene_of(town)
    built_s = time.process_time() - begin
    world = World(town, WorldConfig(vehicles=VEHICLES, walkers=WALKERS))
    world.reset(SEED, [])
    world.advance(np.zeros((0, 3)), WARM_UP_TICKS)
    table = Table("sensor", "weather", "median ms", "worst place ms")

    def add(name: str, weather: str, sensor_of: Callable[[int], CameraRig | Lidar]) -> None:
        times = milliseconds(world, sensor_of, options.places, options.rounds)
        table.add_row(name, weather, f"{statistics.median(times):.2f}", f"{max(times):.2f}")

    for name in ("small", "paper", "rl"):
        for weather in ("ClearNoon", "HardRainNoon", "ClearNight"):
            look = weather_of(weather)
            add(
                f"cameras {name}",
                weather,
                lambda ego, rig=RIGS[name], look=look: CameraRig(town, rig, look, ego),  # type: ignore[misc]
            )
    for name, lidar in LIDARS.items():
        add(f"lidar {name}", "", lambda ego, lidar=lidar: Lidar(town, lidar, ego))  # type: ignore[misc]
    console = Console()
    console.print(f"{cpu_capability()}; scene built in {built_s:.1f} s")
    console.print(table)


if __name__ == "__main__":
    main()
