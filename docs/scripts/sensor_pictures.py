"""Draws the pictures of what cameras and LiDAR see, for the README and docs/environments.md.

python docs/scripts/sensor_pictures.py
"""

from __future__ import annotations

import copy
import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pictures import IMAGES, liveliest_moment
from PIL import Image

from di_envs.route_env import RouteEnv
from di_envs.sensors.camera.config import RIGS
from di_envs.sensors.scene.tags import PALETTE
from di_envs.town.lanes import LaneKind, LightState
from di_envs.world.state import ActorKind, views_of
from di_envs.world.world import WorldView

TILE, SMALL = (640, 360), (400, 225)  # pixels of a camera's picture
SWEEP_PX, SWEEP_M = 720, 45.0  # side of the sweep's picture, and how far it reaches
NAMES = ("camera_left", "camera_front", "camera_right", "camera_back")
WEATHERS = (
    "ClearNoon",
    "CloudySunset",
    "WetSunset",
    "MidRainyNoon",
    "HardRainNoon",
    "ClearNight",
)


def see(moment: RouteEnv, **options: Any) -> dict[str, Any]:
    """What an agent with other sensors would see at the same moment."""
    env = RouteEnv(suite="town05_long", **options)
    env.restore_state(moment.save_state())
    if "weather" in options:
        env.change_weather(options["weather"])  # the snapshot has brought its own along
    return env.observe()


def weather_rows(moment: RouteEnv) -> list[Image.Image]:
    """The four cameras in each weather, one row after the other.

    Raises:
        ValueError: If two weathers look the same.
    """
    rows: dict[bytes, str] = {}
    tiles = []
    for name in WEATHERS:
        seen = see(moment, observations=("camera",), cameras="paper", weather=name)
        row = b"".join(seen[camera].tobytes() for camera in NAMES)
        if row in rows:
            raise ValueError(f"{name} looks as {rows[row]} does, to the bit: nothing changed it")
        rows[row] = name
        tiles += [tile(seen[camera], SMALL) for camera in NAMES]
    return tiles


def tile(picture: NDArray[np.uint8], size: tuple[int, int] = TILE) -> Image.Image:
    """One camera's picture, as small as the page wants it."""
    return Image.fromarray(picture).resize(size, Image.Resampling.LANCZOS)


def sheet(tiles: list[Image.Image], columns: int) -> Image.Image:
    """Pictures of one size in rows."""
    width, height = tiles[0].size
    rows = -(-len(tiles) // columns)
    page = Image.new("RGB", (columns * width, rows * height))
    for k, picture in enumerate(tiles):
        page.paste(picture, (k % columns * width, k // columns * height))
    return page


def sweep(points: NDArray[np.float32]) -> Image.Image:
    """A LiDAR sweep from above, ahead being up; the higher a point, the warmer its colour."""
    hit = points[np.abs(points).any(axis=1)]
    column = ((hit[:, 1] / SWEEP_M + 1.0) * 0.5 * SWEEP_PX).astype(int)
    row = ((1.0 - hit[:, 0] / SWEEP_M) * 0.5 * SWEEP_PX).astype(int)
    shown = (column >= 0) & (column < SWEEP_PX) & (row >= 0) & (row < SWEEP_PX)
    height = np.clip(hit[:, 2] / 4.0, 0.0, 1.0)[:, None]
    cold, warm = np.array([70.0, 130.0, 180.0]), np.array([255.0, 170.0, 60.0])
    picture = np.full((SWEEP_PX, SWEEP_PX, 3), 18, np.uint8)
    order = np.argsort(hit[:, 2])
    order = order[shown[order]]
    picture[row[order], column[order]] = (cold + height * (warm - cold))[order].astype(np.uint8)
    return Image.fromarray(picture)


def places(moment: RouteEnv) -> dict[str, tuple[float, float, float, float]]:
    """Poses (x, y, z, yaw) worth a look at this moment, by what is to be seen."""
    view = moment.view
    state, town = view.state, view.town
    lanes, signals = town.lanes, town.signals
    points, driving = lanes.points, lanes.kind[lanes.point_lane] == LaneKind.DRIVING
    straight = driving & (lanes.junction[lanes.point_lane] < 0)
    found = {}
    red = signals.stop_pose[np.flatnonzero(state.light[signals.stop_signal] == LightState.RED)]
    crossing = np.array([_others_near(view, pose, 45.0) for pose in red])
    found["red light"] = _back(red[crossing.argmax()], 7.0)
    high = points[straight & (points[:, 2] > 9.0)][::20]
    busy = np.array([_others_near(view, _back(pose, -16.0), 15.0) for pose in high])
    busy -= np.array([100 * _others_near(view, pose, 7.0) for pose in high])
    found["ring"] = high[busy.argmax()]
    deck, low = points[points[:, 2] > 8.0, :2][::4], points[straight & (points[:, 2] < 0.1)][::4]
    beside = np.array([_to_nearest(deck, pose) for pose in low])
    ahead = np.array([_to_nearest(deck, _back(pose, -20.0)) for pose in low])
    found["below the bridge"] = low[np.where(beside > 9.0, ahead, np.inf).argmin()]
    buses = np.flatnonzero((state.kind == ActorKind.BUS) & (lanes.junction[state.lane] < 0))
    poses = np.stack([state.x, state.y, state.z, state.yaw], axis=1)[buses]
    behind = [_back(pose, 9.0) for pose in poses]
    alone = np.array([_others_near(view, pose, 4.0) for pose in behind])
    found["behind a bus"] = behind[alone.argmin()]
    return {name: tuple(float(number) for number in pose) for name, pose in found.items()}


def _to_nearest(others: Any, pose: Any) -> float:
    return float(np.hypot(*(others - pose[:2]).T).min())


def _back(pose: Any, metres: float) -> Any:
    x, y, z, yaw = pose
    return np.array([x - metres * np.cos(yaw), y - metres * np.sin(yaw), z, yaw])


def _others_near(view: WorldView, pose: Any, reach_m: float) -> int:
    """How many others are near a pose, on its level."""
    state = view.state
    there = (state.kind > 0) & (state.kind < ActorKind.PROP) & (abs(state.z - pose[2]) < 3.0)
    return int((there & (np.hypot(state.x - pose[0], state.y - pose[1]) < reach_m)).sum())


def moved(moment: RouteEnv, pose: tuple[float, float, float, float]) -> RouteEnv:
    """The same moment with the ego elsewhere."""
    there = moment.twin()
    snapshot = copy.deepcopy(moment.save_state())
    state = views_of(snapshot.world.record)
    state.x[0], state.y[0], state.z[0], state.yaw[0] = pose
    there.restore_state(snapshot)
    return there


def depth_in_grey(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Depth as brightness: near is bright, by the logarithm, 1 m to 200 m."""
    share = 1.0 - np.log(np.clip(depth, 1.0, 200.0)) / np.log(200.0)
    return np.repeat((255 * share).astype(np.uint8)[..., None], 3, axis=2)


def instances_in_colour(instance: NDArray[np.int32]) -> NDArray[np.uint8]:
    """Each actor in a colour of its own, what is no actor in black."""
    colours = np.random.default_rng(3).integers(60, 256, (int(instance.max()) + 1, 3))
    colours[0] = 0
    return colours[instance].astype(np.uint8)


def main() -> None:
    """Draws all sheets."""
    moment, _ = liveliest_moment("0", 2, 139.6)
    seen = see(moment, observations=("camera", "lidar"), cameras="paper", lidar="dense")
    cameras = sheet([tile(seen[name]) for name in NAMES], columns=2)
    page = Image.new("RGB", (cameras.width + SWEEP_PX, cameras.height))
    page.paste(cameras, (0, 0))
    page.paste(sweep(seen["lidar"]), (cameras.width, 0))
    views = []
    for pose in places(moment).values():
        seen = see(moved(moment, pose), observations=("camera",), cameras="paper")
        views.append(tile(seen["camera_front"]))
    rig = dataclasses.replace(RIGS["paper"], depth=True, semantic=True, instance=True)
    rig = dataclasses.replace(rig, cameras=rig.cameras[:1])
    seen = see(moment, observations=("camera",), cameras=rig)
    kinds = [
        tile(seen["camera_front"]),
        tile(depth_in_grey(seen["camera_front_depth"])),
        tile(np.array(PALETTE, np.uint8)[seen["camera_front_semantic"]]),
        tile(instances_in_colour(seen["camera_front_instance"])),
    ]
    for name, picture in (
        ("sensors.jpg", page),
        ("weathers.jpg", sheet(weather_rows(moment), columns=4)),
        ("places.jpg", sheet(views, columns=2)),
        ("images.jpg", sheet(kinds, columns=2)),
    ):
        picture.save(IMAGES / name, quality=85)
        print(f"written: {IMAGES / name}")


if __name__ == "__main__":
    main()
