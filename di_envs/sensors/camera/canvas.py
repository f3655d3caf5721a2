"""What a camera paints on, and what it paints: the bundles that the kernels of cameras share."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Float32, Int32, UInt8, UInt32, UInt64
from di_envs.numerics.bundles import by_reference
from di_envs.sensors.camera.config import STEEP_RAD, CameraConfig, Rig
from di_envs.sensors.camera.projection import Camera, Projected
from di_envs.sensors.camera.spans import BLOCK, whole
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
    # of the row: R is W and room for spans that end with a whole block, see `spans.py`
    near: Float32  # (R,) depths
    code: Int32  # (R,) 6 times the box's number and the face, -1 where there is no box
    ends: UInt8  # (R,) whether a pixel is the last of a run of equal codes
    end_words: UInt64  # (R // 8,) the same memory
    red: Float32  # (R,)
    green: Float32
    blue: Float32
    shadow: Float32
    water: Float32  # (R,) how deep it stands on the ground
    pattern: Float32  # (R,) of windows and leaves, or depths of samples
    samples: Float32  # (4, R) colours and water before they are spread
    texel: Int32  # (R,) first one of four, in a level
    share: Int32  # (R,) between them
    found: UInt32  # (4 R,) texels
    untagged: UInt8  # (0,) for where no tags are asked for


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
    room = whole(width) + 2 * BLOCK
    near, red, green, blue, shadow, water, pattern = np.zeros((7, room), np.float32)
    ends = np.zeros(room, np.uint8)
    return Canvas(
        cam=_camera_of(camera),
        rgb=np.zeros((height, 3 * width), np.uint8),
        depth=np.zeros((height, width), np.float32),
        tag=np.zeros((height if rig.semantic else 0, width), np.uint8),
        instance=np.zeros((height if rig.instance else 0, width), np.int32),
        near=near,
        code=np.zeros(room, np.int32),
        ends=ends,
        end_words=ends.view(np.uint64),
        red=red,
        green=green,
        blue=blue,
        shadow=shadow,
        water=water,
        pattern=pattern,
        samples=np.zeros((4, room), np.float32),
        texel=np.zeros(room, np.int32),
        share=np.zeros(room, np.int32),
        found=np.zeros(4 * room, np.uint32),
        untagged=np.zeros(0, np.uint8),
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
