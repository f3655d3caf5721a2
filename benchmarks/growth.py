"""How the cost of a tick and of a step grows with vehicles, walkers, lanes and the route's length.

    python benchmarks/growth.py
    python benchmarks/growth.py --parts lanes --towns 1 4

Prints medians of processor time and asserts nothing; what is compared takes turns. Where nothing
near changes, a row should cost no more than the one before: towns lie side by side in one map,
with as many vehicles in all of them as in one, and long routes begin with the same minute. How
the cost grows with egos is in `learning.py`.
"""

from __future__ import annotations

import argparse
import copy
import statistics
import tempfile
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import track
from step_works import (
    GROWTH,
    SEED,
    STAND,
    VEHICLES,
    WALKERS,
    WARM_UP_S,
    Work,
    crowd,
    drive_works,
    growth_works,
)

from di_envs.route_env import RouteEnv
from di_envs.suites import DATA
from di_envs.town.loading import TOWNS as SHIPPED
from di_envs.town.loading import load_town

PARTS = ("traffic", "lanes", "routes")
TOWNS = (1, 2, 5, 10, 20)
LONG = DATA / "routes" / "town05_long.xml"
ROUTES = (1, 2, 5, 10)  # of Town05 Long, driven one after the other
APART_M = 1000.0  # towns side by side
ROOM = 1_000_000  # between the ids of two towns
STEPS = 240
# Attributes that name roads, junctions, signals, controllers or objects, by element
_NAMES = {
    "road": ("id", "junction"),
    "junction": ("id",),
    "connection": ("incomingRoad", "connectingRoad"),
    "controller": ("id",),
    "control": ("signalId",),
    "signal": ("id",),
    "signalReference": ("id",),
    "object": ("id",),
    "predecessor": ("elementId",),
    "successor": ("elementId",),
}


def towns_side_by_side(count: int) -> str:
    """OpenDRIVE of so many copies of the shipped Town05, apart from each other."""
    root = ET.parse(SHIPPED["town05"]).getroot()
    parts = [part for part in root if part.tag != "header"]
    for number in range(1, count):
        for part in copy.deepcopy(parts):
            for element in part.iter():
                for name in _NAMES.get(element.tag, ()):
                    if element.get(name, "-1") != "-1":
                        element.set(name, str(int(element.attrib[name]) + number * ROOM))
                if element.tag == "geometry":
                    element.set("x", repr(float(element.attrib["x"]) + number * APART_M))
            root.append(part)
    return ET.tostring(root, encoding="unicode")


def joined_routes(count: int) -> str:
    """A route file with one route: so many of Town05 Long, one after the other."""
    routes = ET.parse(LONG).getroot().findall("route")
    root = ET.Element("routes")
    joined = ET.SubElement(root, "route", {"id": "0", "town": "Town05"})
    for route in routes[:count]:
        joined.extend(route.findall("waypoint"))
    return ET.tostring(root, encoding="unicode")


def standing(env: RouteEnv) -> Work:
    """Steps with an ego that stands, from the same state again and again."""
    env.reset(seed=SEED, options={"route": 0})
    for _ in range(round(WARM_UP_S / env.config.control_dt_s)):
        env.step(STAND)
    snapshot = env.save_state()

    def work() -> None:
        env.restore_state(snapshot)
        for _ in range(STEPS):
            env.step(STAND)

    return STEPS, work


def medians_us(
    works: dict[str, Work], rounds: int, console: Console, what: str
) -> dict[str, float]:
    """Microseconds of processor time of one thing, by work; the first round is not counted."""
    found: dict[str, list[float]] = {name: [] for name in works}
    for number in track(range(rounds + 1), what, console=console, transient=True):
        for name, (count, work) in works.items():
            begin = time.process_time()
            work()
            if number:
                found[name].append((time.process_time() - begin) / count * 1e6)
    return {name: statistics.median(times) for name, times in found.items()}


def measure_traffic(rounds: int, console: Console) -> None:
    """A tick as traffic grows, without an ego."""
    times = medians_us(growth_works(), rounds, console, "traffic")
    print("\n## As traffic grows (no ego)\n")
    print("| vehicles | walkers | a tick [µs] |")
    print("|---:|---:|---:|")
    for vehicles, walkers in GROWTH:
        print(f"| {vehicles} | {walkers} | {times[f'{vehicles} | {walkers}']:.1f} |")


def measure_lanes(rounds: int, console: Console, folder: Path, towns: Sequence[int]) -> None:
    """A tick and a step as the map grows."""
    ticks, spread, steps, lanes = dict[str, Work](), dict[str, Work](), dict[str, Work](), []
    for count in track(towns, "reading maps", console=console, transient=True):
        place = folder / f"{count}" / "Town05.xodr"
        place.parent.mkdir()
        place.write_text(towns_side_by_side(count))
        town = load_town(place, cached=False)
        lanes.append(len(town.lanes.kind))
        ticks[str(count)] = crowd(town, VEHICLES, WALKERS)
        spread[str(count)] = crowd(town, VEHICLES * count, WALKERS * count)
        env = RouteEnv(
            town=str(place),
            routes=str(LONG),
            observations=("prompt",),
            traffic=VEHICLES,
            walkers=WALKERS,
            cached=False,
        )
        steps[str(count)] = standing(env)
    shown = [medians_us(works, rounds, console, "lanes") for works in (ticks, steps, spread)]
    print("\n## As the map grows\n")
    print(f"{VEHICLES} vehicles and {WALKERS} walkers in all; in the last column, in each town.\n")
    print(
        "| towns | lanes | a tick, no ego [µs] | a step, ego stands [µs] | a tick for a town [µs] |"
    )
    print("|---:|---:|---:|---:|---:|")
    for count, number in zip(towns, lanes, strict=True):
        tick, step, full = (times[str(count)] for times in shown)
        print(f"| {count} | {number:,} | {tick:.1f} | {step:.1f} | {full / count:.1f} |")


def measure_routes(rounds: int, console: Console, folder: Path) -> None:
    """A step along the first minute of ever longer routes."""
    works, length_m = dict[str, Work](), dict[str, float]()
    for count in track(ROUTES, "planning routes", console=console, transient=True):
        place = folder / f"joined{count}.xml"
        place.write_text(joined_routes(count))
        env = RouteEnv(
            town="town05",
            routes=str(place),
            observations=("prompt",),
            traffic=VEHICLES,
            walkers=WALKERS,
        )
        works[str(count)] = drive_works(env)["env"]
        length_m[str(count)] = env.plans[0].length_m
    times = medians_us(works, rounds, console, "routes")
    print("\n## As the route grows\n")
    print("| route [km] | a step, along the expert's drive [µs] |")
    print("|---:|---:|")
    for count in works:
        print(f"| {length_m[count] / 1000.0:.1f} | {times[count]:.1f} |")


def main() -> None:
    """Measures the parts asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="default: all")
    parser.add_argument("--rounds", type=int, default=5, help="timed rounds (default: 5)")
    parser.add_argument(
        "--towns", nargs="+", type=int, default=TOWNS, metavar="N", help="in one map (default: all)"
    )
    arguments = parser.parse_args()
    if arguments.rounds < 1:
        parser.error(f"--rounds must be at least 1, not {arguments.rounds}")
    if min(arguments.towns) < 1:
        parser.error(f"--towns must be at least 1 each, not {min(arguments.towns)}")
    console = Console(stderr=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        measures: dict[str, Callable[[], None]] = {
            "traffic": lambda: measure_traffic(arguments.rounds, console),
            "lanes": lambda: measure_lanes(arguments.rounds, console, folder, arguments.towns),
            "routes": lambda: measure_routes(arguments.rounds, console, folder),
        }
        for part in arguments.parts:
            measures[part]()


if __name__ == "__main__":
    main()
