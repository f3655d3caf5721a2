"""The front camera that people look through, where the agent has no cameras of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from di_envs.sensors.camera.config import CameraConfig, Rig, rig_of

FRONT = "camera_front"
_SHIPPED = "small"


def with_front_camera(options: Mapping[str, Any]) -> dict[str, Any]:
    """Environment options that show the front camera too; as they are where cameras are seen.

    Args:
        options: With `observations`. A rig that they name is used: its front camera alone, as
            others would only cost time, or the shipped one where the rig has none.
    """
    groups = options["observations"]
    if isinstance(groups, str) or "camera" in groups:  # every preset has one
        return dict(options)
    given = options.get("cameras", _SHIPPED)
    camera = front_camera(given) or front_camera(_SHIPPED)
    assert camera is not None
    return {**options, "observations": (*groups, "camera"), "cameras": Rig(cameras=(camera,))}


def front_camera(cameras: str | Rig) -> CameraConfig | None:
    """The camera of a rig that looks ahead; None if it has none."""
    found = (camera for camera in rig_of(cameras).cameras if camera.name == FRONT)
    return next(found, None)
