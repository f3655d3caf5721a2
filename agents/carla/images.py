"""Images as CARLA's cameras hand them out: blue, green, red and alpha, a byte each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from di_envs.sensors.camera.config import CameraConfig

FAR_M = 1000.0  # CARLA's, at which its depth is full
_LEVELS = 2**24 - 1


def bgra(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(H, W, 3) red, green, blue as (H, W, 4) blue, green, red, alpha 255."""
    image = np.full((*rgb.shape[:2], 4), 255, np.uint8)
    image[..., :3] = rgb[..., ::-1]
    return image


def depth_image(depth_m: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(H, W) metres as CARLA codes them: red + 256 green + 65536 blue, of 2**24 - 1 for 1 km."""
    levels = np.rint(np.clip(depth_m / FAR_M, 0.0, 1.0).astype(np.float64) * _LEVELS)
    code = levels.astype(np.int64)
    return bgra(np.stack([code & 255, code >> 8 & 255, code >> 16], axis=-1).astype(np.uint8))


def semantic_image(tags: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(H, W) tags as the red of an image."""
    image = np.zeros((*tags.shape, 3), np.uint8)
    image[..., 0] = tags
    return bgra(image)


def instance_image(tags: NDArray[np.uint8], ids: NDArray[np.int32]) -> NDArray[np.uint8]:
    """(H, W) tags as red, the low byte of an actor's id as green and the high one as blue."""
    return bgra(np.stack([tags, ids & 255, ids >> 8 & 255], axis=-1).astype(np.uint8))


def empty_image(camera: CameraConfig) -> NDArray[np.uint8]:
    """(H, W, 4) black, of a camera that cannot be as it is asked for."""
    return bgra(np.zeros((camera.height, camera.width, 3), np.uint8))
