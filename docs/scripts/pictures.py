"""Draws the documentation's pictures from the environment: `python -m docs.scripts.pictures`.

`images/town05.png` is a moment of a drive in the shipped town: the whole of it and the streets
around the ego. `images/prompt.png` is what an agent is told at that moment, in the ego frame.
`images/view.png` is that moment as `render_mode="rgb_array"` shows it. `images/lidar.png` is a
sweep of the LiDAR at that moment, over the map.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon, Rectangle
from numpy.typing import NDArray
from PIL import Image

from agents import load_agent
from di_envs.drawing.outlines import (
    ACTOR,
    BRIDGE_M,
    EDGE,
    EGO,
    LIGHT,
    PAPER,
    ROUTE,
    Array,
    box,
)
from di_envs.route_env import RouteEnv
from di_envs.sensors.lidar.config import LidarConfig
from di_envs.sensors.lidar.sweep import Lidar
from di_envs.sensors.scene.tags import PALETTE, Tag
from di_envs.town.lanes import LightState
from di_envs.town.map_chunks import MapKind
from di_envs.world.state import ActorKind
from di_envs.world.world import WorldView
from docs.scripts.map_drawing import (
    draw_actors,
    draw_crosswalks,
    draw_route,
    draw_signals,
    draw_town,
    frame,
)

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # (after the choice of a backend without windows)

IMAGES = Path(__file__).resolve().parents[1] / "images"
NEAR_M = (68.0, 76.0)  # width and height of the second panel
SWEEP_M = (96.0, 84.0)  # … of the picture of the LiDAR
# brighter than CARLA's palette where that is as dark as the map below
SWEEP_COLOURS = {
    Tag.ROADS: "#d9c8dd",
    Tag.ROAD_LINES: "#ffffff",
    Tag.TERRAIN: "#2f8f3a",
    Tag.SIDEWALKS: "#f423e8",
    Tag.CAR: "#2f6bff",
    Tag.TRUCK: "#00c2d1",
    Tag.BUS: "#00c2d1",
    Tag.BUILDINGS: "#111111",
}


def liveliest_moment(route: str, seed: int, seconds: float) -> tuple[RouteEnv, dict[str, Any]]:
    """The expert drives a route of `town05_long`; returns to when most could be seen around it."""
    env = RouteEnv(suite="town05_long", observations=("prompt",))
    agent = load_agent("expert")
    observation, _ = env.reset(seed=seed, options={"route": route})
    memory = agent.start(env.plan, seed)
    most, best = -1, (env.save_state(), observation)
    for _ in range(round(seconds / env.config.control_dt_s)):
        control, memory = agent.act({**observation, "world": env.view}, memory)
        observation, _, terminated, truncated, _ = env.step(control)
        if terminated or truncated:
            break
        if liveliness(env.view) > most:
            most, best = liveliness(env.view), (env.save_state(), observation)
    env.restore_state(best[0])
    return env, best[1]


def liveliness(view: WorldView) -> int:
    """How much the second panel would show: others, kinds of them, colours of lights."""
    state, signals, ego = view.state, view.town.signals, view.ego
    half = 0.45 * np.array(NEAR_M)

    def shown(x: Array, y: Array, z: Array) -> NDArray[np.bool_]:
        beside = (abs(x - state.x[ego]) < half[0]) & (abs(y - state.y[ego]) < half[1])
        return beside & (abs(z - state.z[ego]) < BRIDGE_M)

    others = np.unique(state.kind[shown(state.x, state.y, state.z)], return_counts=True)
    counts = {kind: count for kind, count in zip(*others, strict=True) if 0 < kind < 8}
    lines = shown(*signals.stop_pose[:, :3].T)
    colours = set(state.light[signals.stop_signal[lines]].tolist()) - {LightState.NONE}
    moving = 4 if state.speed[ego] > 3.0 else 0
    return sum(counts.values()) + 2 * len(counts) + 4 * len(colours) + moving


def town_picture(env: RouteEnv) -> plt.Figure:
    """The whole town, and the streets around the ego."""
    view = env.view
    figure = plt.figure(figsize=(15.0, 8.2), dpi=130, facecolor=PAPER)
    grid = figure.add_gridspec(1, 2, width_ratios=(1.29, 1.0), wspace=0.03)
    whole, near = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])
    xy = view.town.lanes.points[:, :2]
    low, high = xy.min(axis=0) - 8.0, xy.max(axis=0) + 8.0
    frame(whole, "The shipped Town05-style map and one route", low, high)
    draw_town(whole, view, line_width=0.4)
    draw_signals(whole, view, line_width=2.2)
    draw_route(whole, view, line_width=4.0, targets=False)
    draw_actors(whole, view, scale=1.25, ego_scale=2.2, walker_size=2.2)
    ego = np.array([view.state.x[view.ego], view.state.y[view.ego]])
    corner = ego - np.array(NEAR_M) / 2
    outline: dict[str, Any] = {"fill": False, "edgecolor": "#222222", "linewidth": 1.4}
    whole.add_patch(Rectangle(tuple(corner), *NEAR_M, zorder=30, **outline))
    frame(near, "Around the ego: lights, traffic, walkers", corner, corner + NEAR_M)
    draw_town(near, view, line_width=1.1)
    draw_crosswalks(near, view)
    draw_signals(near, view, line_width=6.0)
    draw_route(near, view, line_width=6.0, targets=True)
    draw_actors(near, view, scale=1.0, ego_scale=1.0, walker_size=7.0)
    figure.legend(handles=legend(), loc="lower center", ncols=11, frameon=False, fontsize=10.5)
    figure.subplots_adjust(left=0.01, right=0.99, top=0.955, bottom=0.06)
    return figure


def legend() -> list[Any]:
    """What the colours stand for."""

    def square(colour: str, label: str) -> Line2D:
        marks: dict[str, Any] = {
            "marker": "s",
            "markersize": 9,
            "markeredgecolor": EDGE,
            "mew": 0.5,
        }
        return Line2D([], [], linestyle="", color=colour, label=label, **marks)

    return [
        Line2D([], [], color=ROUTE, linewidth=4, label="route"),
        square(EGO, "ego"),
        square(ACTOR[ActorKind.CAR], "car"),
        square(ACTOR[ActorKind.VAN], "van"),
        square(ACTOR[ActorKind.BUS], "bus, truck"),
        square(ACTOR[ActorKind.BICYCLE], "bicycle"),
        square(ACTOR[ActorKind.MOTORCYCLE], "motorcycle"),
        Line2D([], [], linestyle="", marker="o", color=ACTOR[ActorKind.WALKER], label="walker"),
        Line2D([], [], color=LIGHT[LightState.RED], linewidth=4, label="light"),
        square("#ffffff", "stop sign"),
        square(ACTOR[ActorKind.DEBRIS], "debris"),
    ]


def prompt_picture(observation: dict[str, Any]) -> plt.Figure:
    """The structured prompt in the ego frame: x ahead is up, y right is right."""
    figure, axes = plt.subplots(figsize=(8.0, 7.2), dpi=120, facecolor=PAPER)
    axes.set_facecolor("#f7f7f4")
    for kind, colour, style in (
        (MapKind.LANE_CENTRE, "#b9bdc4", "dotted"),
        (MapKind.BROKEN_LINE, "#8a9099", "dashed"),
        (MapKind.SOLID_LINE, "#4a4f57", "solid"),
    ):
        lines = observation["map"]
        chosen = lines[(lines[:, 0, 2] == kind) & (lines[:, :, 3].min(axis=1) > 0)]
        axes.add_collection(
            LineCollection(
                list(chosen[:, :, 1::-1]),
                color=colour,
                linestyle=style,
                linewidth=1.0,
                label=f"map: {kind.name.lower().replace('_', ' ')}",
            )
        )
    routing = observation["routing"][observation["routing"][:, 3] > 0]
    axes.plot(routing[:, 1], routing[:, 0], color=ROUTE, linewidth=4, alpha=0.7, label="routing")
    target = observation["target_point"]
    axes.plot(
        target[1], target[0], "o", color=ROUTE, markersize=11, mec="white", label="target_point"
    )
    _draw_obstacles(axes, observation["obstacles"])
    for x, y, yaw, state, valid in observation["traffic_lights"]:
        if valid:
            across = np.array([np.cos(yaw), -np.sin(yaw)]) * 1.6  # (right, ahead)
            line = np.array([y, x]) + np.array([-across, across])
            axes.plot(*line.T, color=LIGHT[LightState(int(state))], linewidth=5)
    axes.plot([], [], color=LIGHT[LightState.RED], linewidth=5, label="traffic_lights")
    axes.add_patch(Polygon(box(0, 0, np.pi / 2, 2.45, 1.06), facecolor=EGO, label="the ego"))
    axes.set(xlim=(-48, 48), ylim=(-32, 52), xlabel="y: right of the ego [m]")
    axes.set_ylabel("x: ahead of the ego [m]")
    axes.set_aspect("equal")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False, fontsize=10)
    axes.set_title("The prompt: what an agent is told", loc="left", fontsize=12, color="#333333")
    return figure


def _draw_obstacles(axes: Axes, obstacles: NDArray[np.float32]) -> None:
    shown = set()
    for x, y, yaw, length, width, vx, vy, kind, valid in obstacles:
        if not valid:
            continue
        walker = kind == ActorKind.WALKER
        # ahead is up: a right-handed picture of a left-handed frame, so yaw counts from the top
        size = (0.6, 0.6) if walker else (length / 2, width / 2)  # walkers larger, to be seen
        outline = box(y, x, np.pi / 2 - yaw, *size)
        label = "obstacles: walkers" if walker else "obstacles: vehicles"
        colour = "#e0a800" if walker else "#7d8794"
        axes.add_patch(
            Polygon(outline, facecolor=colour, label=None if label in shown else label, zorder=3)
        )
        shown.add(label)
        if np.hypot(vx, vy) > 0.5:
            axes.arrow(y, x, vy, vx, head_width=0.9, color="#333333", linewidth=0.7, zorder=4)


def view_picture(env: RouteEnv) -> NDArray[np.uint8]:
    """The view for people of the same moment, with the front camera."""
    filmed = RouteEnv(
        suite="town05_long", observations=("prompt", "camera"), render_mode="rgb_array"
    )
    filmed.restore_state(env.save_state())
    picture: NDArray[np.uint8] = filmed.render()
    return picture


def lidar_picture(env: RouteEnv) -> plt.Figure:
    """A sweep over the map, in the world frame, coloured by what was hit."""
    view, state = env.view, env.view.state
    dense = LidarConfig(steps=1800, dropoff=0.0, dropoff_zero=0.0, semantic=True)
    lidar = Lidar(view.town, dense, view.ego)
    lidar.start(view)
    sweep = lidar.observe()
    hit = sweep["lidar"][:, 3] > 0.0
    points, tags = sweep["lidar"][hit], sweep["lidar_semantic"][hit]
    c, s = np.cos(state.yaw[view.ego]), np.sin(state.yaw[view.ego])
    ego = np.array([state.x[view.ego], state.y[view.ego]])
    x, y = (
        ego[0] + c * points[:, 0] - s * points[:, 1],
        ego[1] + s * points[:, 0] + c * points[:, 1],
    )
    figure, axes = plt.subplots(figsize=(9.6, 8.4), dpi=110, facecolor=PAPER)
    corner = ego - np.array(SWEEP_M) / 2
    title = "A sweep of 32 x 1800 rays over the map, by what was hit"
    frame(axes, title, corner, corner + SWEEP_M)
    draw_town(axes, view, line_width=1.0)
    for tag in np.unique(
        tags[(abs(x - ego[0]) < SWEEP_M[0] / 2) & (abs(y - ego[1]) < SWEEP_M[1] / 2)]
    ):
        colour = SWEEP_COLOURS.get(Tag(tag), tuple(np.array(PALETTE[tag]) / 255.0))
        label = Tag(tag).name.lower().replace("_", " ")
        chosen = tags == tag
        axes.plot(x[chosen], y[chosen], ".", ms=2.2, mew=0, color=colour, zorder=20 + (tag > 10))
        axes.plot([], [], "o", color=colour, mec=EDGE, mew=0.5, label=label)
    outline = box(float(ego[0]), float(ego[1]), float(state.yaw[view.ego]), 2.45, 1.06)
    axes.add_patch(Polygon(outline, facecolor=EGO, edgecolor="white", zorder=30, label="the ego"))
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False, fontsize=10)
    return figure


def main() -> None:
    """Draws the pictures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--route", default="3", help="id of a route of town05_long")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--seconds", type=float, default=139.6, help="of driving before the picture"
    )
    parser.add_argument("--output", type=Path, default=IMAGES, help="folder of the pictures")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    env, observation = liveliest_moment(arguments.route, arguments.seed, arguments.seconds)
    for name, figure in (
        ("town05.png", town_picture(env)),
        ("prompt.png", prompt_picture(observation)),
        ("lidar.png", lidar_picture(env)),
    ):
        figure.savefig(arguments.output / name, bbox_inches="tight", pad_inches=0.08)
        plt.close(figure)
        print(f"written: {arguments.output / name}")
    Image.fromarray(view_picture(env)).save(arguments.output / "view.png", optimize=True)
    print(f"written: {arguments.output / 'view.png'}")


if __name__ == "__main__":
    main()
