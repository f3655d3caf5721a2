"""How long cameras, LiDARs and whole steps with them take in town among 120 vehicles, on one core.

    python benchmarks/sensors.py                 everything, about two minutes
    python benchmarks/sensors.py --parts steps   whole steps, beside highway-env's and CarRacing's

Prints medians and asserts nothing. Times are of the processor, not of the clock on
the wall, so that other work on the machine disturbs them less.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from sensor_steps import highway_contender, our_contenders, racing_contender, step_rates

from di_envs.numerics.kernels import cpu_capability
from di_envs.sensors.camera.cameras import CameraRig
from di_envs.sensors.camera.config import RIGS
from di_envs.sensors.lidar.config import LIDARS
from di_envs.sensors.lidar.sweep import Lidar
from di_envs.sensors.scene.scene import scene_of
from di_envs.sensors.weather import weather_of
from di_envs.town.loading import load_town
from di_envs.world.world import World, WorldConfig

PARTS = ("sensors", "steps")
RIGS_TIMED = ("small", "paper", "rl")
WEATHERS_TIMED = ("ClearNoon", "HardRainNoon", "ClearNight")
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


def sensor_table(places: int, rounds: int, progress: Progress) -> Table:
    """Each rig in a few weathers, and each LiDAR."""
    town = load_town("town05")
    scene_of(town)
    world = World(town, WorldConfig(vehicles=VEHICLES, walkers=WALKERS))
    world.reset(SEED, [])
    world.advance(np.zeros((0, 3)), WARM_UP_TICKS)
    table = Table("sensor", "weather", "median ms", "worst place ms", title="sensors alone")
    task = progress.add_task("", total=len(RIGS_TIMED) * len(WEATHERS_TIMED) + len(LIDARS))

    def add(name: str, weather: str, sensor_of: Callable[[int], CameraRig | Lidar]) -> None:
        progress.update(task, description=f"{name} {weather}")
        times = milliseconds(world, sensor_of, places, rounds)
        table.add_row(name, weather, f"{statistics.median(times):.2f}", f"{max(times):.2f}")
        progress.advance(task)

    for name in RIGS_TIMED:
        for weather in WEATHERS_TIMED:
            look = weather_of(weather)
            add(
                f"cameras {name}",
                weather,
                lambda ego, rig=RIGS[name], look=look: CameraRig(town, rig, look, ego),  # type: ignore[misc]
            )
    for name, lidar in LIDARS.items():
        add(f"lidar {name}", "", lambda ego, lidar=lidar: Lidar(town, lidar, ego))  # type: ignore[misc]
    return table


def step_table(rounds: int, progress: Progress) -> Table:
    """Whole steps, beside those of others."""
    task = progress.add_task("making environments", total=None)
    contenders = [*our_contenders(100, 20), highway_contender(10)]
    racing = racing_contender(100)
    contenders += [racing] if racing is not None else []
    progress.update(task, total=(rounds + 1) * len(contenders))

    def tell(name: str) -> None:
        progress.update(task, description=name, advance=1)

    rates = step_rates(contenders, rounds, tell)
    table = Table("environment", "sees", "steps/s, median", "best", title="whole env.step")
    for contender in contenders:
        median, best = rates[contender.name]
        table.add_row(contender.name, contender.sees, f"{median:.3g}", f"{best:.3g}")
    if racing is None:
        table.caption = "CarRacing was left out: pip install driveinsight[bench] brings Box2D"
    return table


def main() -> None:
    """Measures what is asked for and prints tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="what to measure")
    parser.add_argument(
        "--places", type=int, default=24, help="vehicles that carry each sensor in turn"
    )
    parser.add_argument("--rounds", type=int, default=5, help="timings of each; medians count")
    options = parser.parse_args()
    console = Console()
    console.print(f"CPU {cpu_capability()}")
    with Progress(console=Console(stderr=True), transient=True) as progress:
        if "sensors" in options.parts:
            console.print(sensor_table(options.places, options.rounds, progress))
        if "steps" in options.parts:
            console.print(step_table(options.rounds, progress))


if __name__ == "__main__":
    main()
