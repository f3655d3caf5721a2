"""What a camera paints on, and what it paints: the bundles that the kernels of cameras share."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.sensors.camera.config import CameraConfig, Rig
from di_envs.sensors.camera.projection import Projected
from di_envs.sensors.scene.boxes import Boxes
from di_envs.sensors.scene.scene import Scene
from di_envs.sensors.weather import Look
from di_envs.world.state import State


@by_reference
class Canvas(NamedTuple):
    """One camera's images, and the row that is being worked on."""

    mount: NDArray[np.float64]  # (9,) see place_camera
    cam: NDArray[np.float64]  # (16,) its numbers at the moment
    rgb: NDArray[np.uint8]  # (H, 3 W)
    depth: NDArray[np.float32]  # (H, W)
    tag: NDArray[np.uint8]  # (H, W), or (0, W) where it is not asked for
    instance: NDArray[np.int32]  # alike
    red: NDArray[np.float32]  # (W,)
    green: NDArray[np.float32]
    blue: NDArray[np.float32]
    u: NDArray[np.float32]  # places in the raster
    v: NDArray[np.float32]
    samples: NDArray[np.float32]  # (4, W + 2) colours and water before they are spread
    texel: NDArray[np.int32]  # (W + 2,) first one of four, in a level
    share: NDArray[np.int32]  # (W + 2,) between them
    found: NDArray[np.uint32]  # (4 W + 8,) texels
    water: NDArray[np.float32]  # (W,) how deep it stands on the ground
    shadow: NDArray[np.float32]
    last: NDArray[np.uint8]
    code: NDArray[np.int32]


@by_reference
class Studio(NamedTuple):
    """All that a picture is made from: one argument, as each costs time."""

    state: State
    scene: Scene
    look: Look
    boxes: Boxes
    seen: Projected


def canvas_of(camera: CameraConfig, rig: Rig) -> Canvas:
    """An empty canvas of a camera, with the images that the rig asks for."""
    height, width = camera.height, camera.width
    beam = max(0.0, math.cos(camera.yaw_rad))
    mount = (
        camera.x_m, camera.y_m, camera.z_m, camera.yaw_rad, camera.pitch_rad,
        camera.focal_px, width / 2.0, height / 2.0, beam,
    )  # fmt: skip
    rows = [np.zeros(width + 2, np.float32) for _ in range(7)]
    return Canvas(
        mount=np.array(mount, np.float64),
        cam=np.zeros(16),
        rgb=np.zeros((height, 3 * width), np.uint8),
        depth=np.zeros((height, width), np.float32),
        tag=np.zeros((height if rig.semantic else 0, width), np.uint8),
        instance=np.zeros((height if rig.instance else 0, width), np.int32),
        red=rows[0][:width],
        green=rows[1][:width],
        blue=rows[2][:width],
        u=rows[3],
        v=rows[4],
        samples=np.zeros((4, width + 2), np.float32),
        texel=np.zeros(width + 2, np.int32),
        share=np.zeros(width + 2, np.int32),
        found=np.zeros(4 * width + 8, np.uint32),
        water=rows[6][:width],
        shadow=rows[5][:width],
        last=np.zeros(width, np.uint8),
        code=np.zeros(width, np.int32),
    )
