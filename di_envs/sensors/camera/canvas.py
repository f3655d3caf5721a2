"""What a camera paints on, and what it paints: the bundles that the kernels of cameras share."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Float32, Int32, UInt8, UInt32
from di_envs.numerics.bundles import by_reference
from di_envs.sensors.camera.config import STEEP_RAD, CameraConfig, Rig
from di_envs.sensors.camera.projection import Camera, Projected
from di_envs.sensors.scene.boxes import Boxes
from di_envs.sensors.scene.scene import Scene
from di_envs.sensors.weather import WeatherLook
from di_envs.world.state import State


@by_reference
class Canvas(NamedTuple):
    """One camera's images, and the row that is being worked on."""

    cam: Camera
    rgb: UInt8  # (H, 3 W)
    depth: Float32  # (H, W)
    tag: UInt8  # (H, W), or (0, W) where it is not asked for
    instance: Int32  # alike
    red: Float32  # (W,)
    green: Float32
    blue: Float32
    u: Float32  # places in the raster
    v: Float32
    samples: Float32  # (4, W + 2) colours and water before they are spread
    texel: Int32  # (W + 2,) first one of four, in a level
    share: Int32  # (W + 2,) between them
    found: UInt32  # (4 W + 8,) texels
    water: Float32  # (W,) how deep it stands on the ground
    shadow: Float32
    last: UInt8
    code: Int32


@by_reference
class Studio(NamedTuple):
    """All that a picture is made from: one argument, as each costs time."""

    state: State
    scene: Scene
    look: WeatherLook
    boxes: Boxes
    seen: Projected


def canvas_of(camera: CameraConfig, rig: Rig) -> Canvas:
    """An empty canvas of a camera, with the images that the rig asks for."""
    height, width = camera.height, camera.width
    rows = [np.zeros(width + 2, np.float32) for _ in range(7)]
    return Canvas(
        cam=_camera_of(camera),
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


def _camera_of(config: CameraConfig) -> Camera:
    """A camera that is not in its place yet."""
    axes = np.zeros((3, 3))
    return Camera(
        x_m=float(config.x_m),
        y_m=float(config.y_m),
        z_m=float(config.z_m),
        yaw_rad=float(config.yaw_rad),
        pitch_rad=float(config.pitch_rad),
        focal_px=float(config.focal_px),
        cx_px=config.width / 2.0,
        cy_px=config.height / 2.0,
        beam=max(0.0, math.cos(config.yaw_rad)) if abs(config.pitch_rad) <= STEEP_RAD else 0.0,
        eye=np.zeros(3),
        axes=axes,
        ahead=axes[0],
        right=axes[1],
        down=axes[2],
    )
