"""Cameras by configuration: size, field of view, mounting; the rigs that are shipped.

Frames: the ego's (x ahead, y right, z up, origin on the ground under the box's centre). A camera
looks along +x of its own frame when its yaw and pitch are 0; yaw turns it clockwise (to the right),
pitch lifts it. A point (a, r, u) ahead, right and up of the camera is seen at
`column = cx + f r / a`, `row = cy - f u / a` (of pixel edges: pixel (0, 0) spans 0 to 1), with
`f = width / 2 / tan(fov / 2)`, `cx = width / 2`, `cy = height / 2`. There is no lens distortion.
"""

from __future__ import annotations

import dataclasses
import math
import numbers
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from di_envs.files.names import name_hint

LARGEST_PX = 8192
STEEP_RAD = math.radians(60.0)  # steeper ones look down or up more than ahead


@dataclass(frozen=True, kw_only=True)
class CameraConfig:
    """One pinhole camera.

    Attributes:
        name: Its key in the observation, such as `camera_front`.
        width: Pixels, 1 to 8192.
        height: Pixels.
        fov_deg: Horizontal field of view, between 0 and 180 degrees, both excluded.
        x_m: Mounting in the ego's frame, ahead.
        y_m: … to the right.
        z_m: … above the ground.
        yaw_rad: Turned to the right.
        pitch_rad: Lifted; at most 90 degrees either way. There is no roll.
    """

    name: str
    width: int = 256
    height: int = 144
    fov_deg: float = 150.0
    x_m: float = 1.3
    y_m: float = 0.0
    z_m: float = 2.3
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name != "name" and not isinstance(value, numbers.Real):
                raise ValueError(
                    f"Camera '{self.name}': {field.name} must be a number; got {value!r}."
                )
        for side in ("width", "height"):
            pixels = getattr(self, side)
            if isinstance(pixels, bool) or pixels % 1 != 0 or not 1 <= pixels <= LARGEST_PX:
                raise ValueError(
                    f"Camera '{self.name}' needs a {side} of 1 to {LARGEST_PX} pixels; got "
                    f"{pixels!r}. Presets: small is 256 x 144, paper 1600 x 900."
                )
        if not 0.0 < self.fov_deg < 180.0:
            raise ValueError(
                f"Camera '{self.name}' needs a field of view between 0 and 180 degrees, both "
                f"excluded, as a flat image has no other; got {self.fov_deg!r}. Use several "
                f"cameras to see all round; the paper's have 150."
            )
        if not abs(self.pitch_rad) <= math.pi / 2.0:
            raise ValueError(
                f"Camera '{self.name}' may be pitched by at most 90 degrees (1.571 rad) either "
                f"way; got {self.pitch_rad!r} rad. Is it in degrees?"
            )
        for place in ("x_m", "y_m", "z_m", "yaw_rad"):
            if not math.isfinite(getattr(self, place)):
                raise ValueError(f"Camera '{self.name}': {place} must be a finite number.")

    @property
    def focal_px(self) -> float:
        """Focal length in pixels, the same for both axes."""
        return self.width / 2.0 / math.tan(math.radians(self.fov_deg) / 2.0)

    def intrinsics(self) -> NDArray[np.float64]:
        """(3, 3) K, for points (right, down, ahead), as OpenCV has it."""
        f = self.focal_px
        return np.array([[f, 0.0, self.width / 2.0], [0.0, f, self.height / 2.0], [0, 0, 1.0]])

    def ego_from_camera(self) -> NDArray[np.float64]:
        """(4, 4) from the camera's frame (ahead, right, up) to the ego's."""
        cy, sy = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        cp, sp = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
        return np.array(
            [
                [cy * cp, -sy, -cy * sp, self.x_m],
                [sy * cp, cy, -sy * sp, self.y_m],
                [sp, 0.0, cp, self.z_m],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where points of the ego's frame are seen.

        Args:
            points: (N, 3) ahead, right, up [m].

        Returns:
            (N, 3) column, row [px] and depth ahead of the camera [m]; NaN for columns and rows of
            points that are not ahead of it.
        """
        turn = self.ego_from_camera()
        local = (np.asarray(points, np.float64) - turn[:3, 3]) @ turn[:3, :3]
        depth = np.where(local[:, 0] > 1e-6, local[:, 0], np.nan)
        column = self.width / 2.0 + self.focal_px * local[:, 1] / depth
        row = self.height / 2.0 - self.focal_px * local[:, 2] / depth
        return np.stack([column, row, local[:, 0]], axis=1)


@dataclass(frozen=True, kw_only=True)
class Rig:
    """Some cameras, and which images besides RGB they take.

    Attributes:
        cameras: In the order of the observation.
        depth: Add `NAME_depth`: (H, W) float32, metres ahead of the camera's plane, `FAR_M` for
            the sky.
        semantic: Add `NAME_semantic`: (H, W) uint8, `Tag`.
        instance: Add `NAME_instance`: (H, W) int32, actor id + 1, 0 for what is no actor.
    """

    cameras: tuple[CameraConfig, ...]
    depth: bool = False
    semantic: bool = False
    instance: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "cameras", tuple(self.cameras))
        names = [camera.name for camera in self.cameras]
        if not names or len(set(names)) != len(names):
            raise ValueError(f"A rig needs cameras with names of their own; got {names}.")


def four_cameras(width: int, height: int, fov_deg: float = 150.0) -> Rig:
    """Front, left, right and back, above the bonnet, as the paper mounts them."""

    def camera(name: str, yaw_deg: float, x_m: float) -> CameraConfig:
        return CameraConfig(
            name=f"camera_{name}",
            width=width,
            height=height,
            fov_deg=fov_deg,
            x_m=x_m,
            yaw_rad=math.radians(yaw_deg),
        )

    return Rig(
        cameras=(
            camera("front", 0.0, 1.3),
            camera("left", -90.0, 1.3),
            camera("right", 90.0, 1.3),
            camera("back", 180.0, -1.3),
        )
    )


def one_camera(width: int, height: int, fov_deg: float) -> Rig:
    """A single camera to the front, as policies of reinforcement learning take it."""
    return Rig(
        cameras=(CameraConfig(name="camera_front", width=width, height=height, fov_deg=fov_deg),)
    )


def with_narrow_camera(rig: Rig) -> Rig:
    """A rig, and a camera that looks far ahead through a narrow window, lifted a little.

    In 256 pixels over 150 degrees a lamp 40 m away is 0.3 pixels wide; here it is 2.9. Lifted by 3
    degrees it has a lit lamp of the next light in view at every distance from 50 m to the line.
    """
    narrow = CameraConfig(
        name="camera_front_narrow",
        width=320,
        height=128,
        fov_deg=50.0,
        pitch_rad=math.radians(3.0),
    )
    return dataclasses.replace(rig, cameras=(*rig.cameras, narrow))


RIGS = {
    "small": four_cameras(256, 144),
    "driveinsight": with_narrow_camera(four_cameras(256, 144)),
    "paper": four_cameras(1600, 900),
    "rl": one_camera(84, 84, 100.0),
}


def rig_of(cameras: str | Rig) -> Rig:
    """A rig, or the shipped one of a name.

    Raises:
        ValueError: If there is no rig of that name; suggests one.
    """
    if isinstance(cameras, Rig):
        return cameras
    if cameras not in RIGS:
        raise ValueError(
            f"Unknown cameras {cameras!r}; {name_hint(cameras, RIGS)}, or give a "
            f"di_envs.sensors.camera.config.Rig."
        )
    return RIGS[cameras]
