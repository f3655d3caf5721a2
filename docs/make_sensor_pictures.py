"""Draws the pictures of what cameras and LiDAR see, for the README and docs/environments.md.

python docs/make_sensor_pictures.py
"""

from __future__ import annotations

from typing import Any

import numpy as np
from make_pictures import IMAGES, liveliest_moment
from numpy.typing import NDArray
from PIL import Image

from di_envs.route_env import RouteEnv

TILE = (640, 360)  # pixels of a camera's picture
SWEEP_PX, SWEEP_M = 720, 45.0  # side of the sweep's picture, and how far it reaches
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
    return env.observe()


def tile(picture: NDArray[np.uint8]) -> Image.Image:
    """One camera's picture, as small as the page wants it."""
    return Image.fromarray(picture).resize(TILE, Image.Resampling.LANCZOS)


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


def main() -> None:
    """Draws both sheets."""
    moment, _ = liveliest_moment("0", 2, 139.6)
    seen = see(moment, observations=("camera", "lidar"), cameras="paper", lidar="dense")
    names = ("camera_left", "camera_front", "camera_right", "camera_back")
    cameras = sheet([tile(seen[name]) for name in names], columns=2)
    page = Image.new("RGB", (cameras.width + SWEEP_PX, cameras.height))
    page.paste(cameras, (0, 0))
    page.paste(sweep(seen["lidar"]), (cameras.width, 0))
    weathers = [
        see(moment, observations=("camera",), cameras="paper", weather=name)["camera_front"]
        for name in WEATHERS
    ]
    for name, picture in (
        ("sensors.jpg", page),
        ("weathers.jpg", sheet([tile(picture) for picture in weathers], columns=3)),
    ):
        picture.save(IMAGES / name, quality=88)
        print(f"written: {IMAGES / name}")


if __name__ == "__main__":
    main()
