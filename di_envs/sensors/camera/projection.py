"""Boxes as a camera sees them: the pixels they may cover, their rays, the light on their faces.

Their shadows are in `shadows.py`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Float32, Float64, Int32, Int64
from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.sensors.scene.boxes import Boxes, Material
from di_envs.sensors.scene.scene import ROOM
from di_envs.sensors.weather import WeatherLook
from di_envs.world.state import State

NEAR = 0.1  # m; nothing nearer is seen
SMALLEST_PX = 0.7  # boxes that look smaller are left out, unless they shine
_SURELY_M = 0.001  # beyond the near plane, whatever rounding does
_GROWN_PX = 0.02  # a ray is traced in single precision: it may meet a box by a hair beside it
_LAMP_GROWN_PX = 1.0  # a lamp blooms where it covers no pixel's middle
_BESIDE_PX = 3.0  # a box that lies further beside the image has no pixel, however it has grown
_LAMP = int(Material.LAMP)


@by_reference
class Camera(NamedTuple):
    """One camera: how it sits on its ego, its lens, and where it is at the moment."""

    # in the ego's frame; yaw positive to the right, pitch upwards
    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    pitch_rad: float
    # the lens
    focal_px: float
    cx_px: float
    cy_px: float
    beam: float  # 0..1: how much of the ego's own headlights falls where it looks
    # in the world frame, written by `place_camera`
    eye: Float64  # (3,) [m]
    axes: Float64  # (3, 3) unit vectors, in its rows: ahead, right and down, which are
    ahead: Float64  # (3,)
    right: Float64  # (3,)
    down: Float64  # (3,)


@by_reference
class Projected(NamedTuple):
    """The V boxes that one camera sees, in the order of the collection, and shadows."""

    count: Int64  # type: ignore[assignment]  # (2,) boxes, shadows
    source: Int32  # (V,) index among the collected boxes
    rect: Int32  # (V, 4) first and end column, first and end row
    # (V, 4, 3) in the box's frame: the camera's place, the ray through pixel (0, 0), 1 ahead, and
    # what a column and a row add to that
    rays: Float32
    faces: Float32  # (6 V, 3) colours in levels
    # shadows, from the camera's place: each is what three strips of the plane have in common
    strips: Float64  # (S, 3, 4) a strip's normal x, y, and least and greatest value along it [m]
    shadow_m: Float64  # (S, 3) least and greatest way ahead of the camera, least width [m]


def projected_buffer() -> Projected:
    """Room for what `project_boxes` finds."""
    return Projected(
        count=np.zeros(2, np.int64),
        source=np.zeros(ROOM, np.int32),
        rect=np.zeros((ROOM, 4), np.int32),
        rays=np.zeros((ROOM, 4, 3), np.float32),
        faces=np.zeros((6 * ROOM, 3), np.float32),
        strips=np.zeros((ROOM, 3, 4)),
        shadow_m=np.zeros((ROOM, 3)),
    )


@kernel
def place_camera(state: State, ego: int, cam: Camera) -> None:
    """Writes where an ego's camera is and how it is turned."""
    c, s = math.cos(state.yaw[ego]), math.sin(state.yaw[ego])
    cam.eye[0] = state.x[ego] + c * cam.x_m - s * cam.y_m
    cam.eye[1] = state.y[ego] + s * cam.x_m + c * cam.y_m
    cam.eye[2] = state.z[ego] + cam.z_m
    yaw, pitch = state.yaw[ego] + cam.yaw_rad, cam.pitch_rad
    c, s, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    cam.ahead[0], cam.ahead[1], cam.ahead[2] = c * cp, s * cp, sp
    cam.right[0], cam.right[1], cam.right[2] = -s, c, 0.0
    cam.down[0], cam.down[1], cam.down[2] = c * sp, s * sp, -cp


@kernel
def project_boxes(
    cam: Camera, boxes: Boxes, look: WeatherLook, width: int, height: int, out: Projected
) -> None:
    """Finds the boxes that a camera sees and prepares their rays and colours.

    Args:
        cam: In its place.
        boxes: What was collected round the ego.
        look: The light.
        width, height: Of the image [px].
        out: Written, but for the shadows.
    """
    out.count[0] = 0
    eye, ahead_axis = cam.eye, cam.ahead
    axes = np.zeros((3, 3))  # of the box, in the world frame
    rel = np.zeros(3)
    in_cam = np.zeros((4, 3))  # middle, then the three half sides: ahead, right, down
    wide = (0.5 * width + _BESIDE_PX) / cam.focal_px  # how far to a side is seen, 1 ahead
    over_wide = math.sqrt(1.0 + wide * wide)
    for b in range(boxes.count[0]):
        radius2 = 0.0
        for k in range(3):
            rel[k] = boxes.centre[b, k] - eye[k]
            radius2 += np.float64(boxes.half[b, k]) * np.float64(boxes.half[b, k])
        radius = math.sqrt(radius2)
        ahead = rel[0] * ahead_axis[0] + rel[1] * ahead_axis[1] + rel[2] * ahead_axis[2]
        if ahead + radius < NEAR:
            continue
        if radius * cam.focal_px < SMALLEST_PX * ahead and boxes.material[b] != _LAMP:
            continue
        right = rel[0] * cam.right[0] + rel[1] * cam.right[1]  # the camera does not roll
        if abs(right) - radius * over_wide > wide * ahead:
            continue
        _axes_of(boxes, b, axes)
        _into_camera(cam.axes, rel, axes, boxes.half[b], in_cam)
        v = out.count[0]
        grown = _LAMP_GROWN_PX if boxes.material[b] == _LAMP else _GROWN_PX
        if _bounds(in_cam, cam, width, height, grown, out.rect[v]):
            out.source[v] = b
            _rays(rel, axes, cam, out.rays[v])
            _light(boxes, b, axes, look, out.rays[v, 0], out.faces[6 * v : 6 * v + 6])
            out.count[0] = v + 1


@kernel
def _into_camera(
    cam_axes: Float64, rel: Float64, axes: Float64, half: Float32, in_cam: Float64
) -> None:
    """Writes a box's middle and half sides as (4, 3), ahead, right and down of the camera [m].

    Args:
        cam_axes: (3, 3) the camera's.
        rel: (3,) from the camera to the box's middle, in the world frame.
        axes: (3, 3) the box's, in the world frame.
        half: (3,) its half sides.
        in_cam: (4, 3) written.
    """
    for k in range(3):
        in_cam[0, k] = rel[0] * cam_axes[k, 0] + rel[1] * cam_axes[k, 1] + rel[2] * cam_axes[k, 2]
        for side in range(3):
            dot = 0.0
            for q in range(3):
                dot += axes[side, q] * cam_axes[k, q]
            in_cam[1 + side, k] = dot * half[side]


@kernel
def _axes_of(boxes: Boxes, b: int, axes: Float64) -> None:
    """Writes a box's axes ahead, right and up in the world frame, (3, 3) in rows."""
    c, s, pitch = boxes.turn[b, 0], boxes.turn[b, 1], np.float64(boxes.pitch[b])
    cp, sp = 1.0, 0.0
    if pitch != 0.0:
        cp, sp = math.cos(pitch), math.sin(pitch)
    axes[0, 0], axes[0, 1], axes[0, 2] = c * cp, s * cp, sp
    axes[1, 0], axes[1, 1], axes[1, 2] = -s, c, 0.0
    axes[2, 0], axes[2, 1], axes[2, 2] = -c * sp, -s * sp, cp


@kernel
def _bounds(box: Float64, cam: Camera, width: int, height: int, grown: float, rect: Int32) -> bool:
    """Writes the pixels whose middles a box may cover; False if there are none.

    Args:
        box: (4, 3) its middle and half sides, ahead, right and down of the camera; what is nearer
            than the near plane is cut off.
        cam: Its lens counts.
        width, height: Of the image.
        grown: Pixels by which the box counts as larger on each side.
        rect: (4,) written.
    """
    focal, cx, cy = cam.focal_px, cam.cx_px, cam.cy_px
    low_x, high_x, low_y, high_y = 1e9, -1e9, 1e9, -1e9
    nearest = box[0, 0] - abs(box[1, 0]) - abs(box[2, 0]) - abs(box[3, 0])
    cut = nearest < NEAR + _SURELY_M
    for corner in range(8):
        a = 1.0 if corner & 1 else -1.0
        r = 1.0 if corner & 2 else -1.0
        u = 1.0 if corner & 4 else -1.0
        z = box[0, 0] + a * box[1, 0] + r * box[2, 0] + u * box[3, 0]
        x = box[0, 1] + a * box[1, 1] + r * box[2, 1] + u * box[3, 1]
        y = box[0, 2] + a * box[1, 2] + r * box[2, 2] + u * box[3, 2]
        if cut and z < NEAR:
            continue
        low_x, high_x = min(low_x, x / z), max(high_x, x / z)
        low_y, high_y = min(low_y, y / z), max(high_y, y / z)
        if not cut:
            continue
        for side in range(3):
            sign = -2.0 * (a if side == 0 else (r if side == 1 else u))
            z2 = z + sign * box[1 + side, 0]
            if z2 < NEAR:
                t = (NEAR - z) / (z2 - z)
                x2 = (x + t * sign * box[1 + side, 1]) / NEAR
                y2 = (y + t * sign * box[1 + side, 2]) / NEAR
                low_x, high_x = min(low_x, x2), max(high_x, x2)
                low_y, high_y = min(low_y, y2), max(high_y, y2)
    if high_x < low_x:
        return False
    rect[0] = math.ceil(min(max(cx + focal * low_x - 0.5 - grown, 0.0), width * 1.0))
    rect[1] = math.floor(min(max(cx + focal * high_x + 0.5 + grown, 0.0), width * 1.0))
    rect[2] = math.ceil(min(max(cy + focal * low_y - 0.5 - grown, 0.0), height * 1.0))
    rect[3] = math.floor(min(max(cy + focal * high_y + 0.5 + grown, 0.0), height * 1.0))
    return rect[1] > rect[0] and rect[3] > rect[2]


@kernel
def _rays(rel: Float64, axes: Float64, cam: Camera, rays: Float32) -> None:
    """Writes a row of `Projected.rays`, (4, 3).

    Args:
        rel: (3,) from the camera to the box's middle, in the world frame [m].
        axes: (3, 3) the box's, in the world frame.
        cam: In its place.
        rays: (4, 3) written.
    """
    focal, ahead, right, down = cam.focal_px, cam.ahead, cam.right, cam.down
    u0, v0 = (0.5 - cam.cx_px) / focal, (0.5 - cam.cy_px) / focal
    for k in range(3):
        a, r, d, e = 0.0, 0.0, 0.0, 0.0
        for q in range(3):
            a += axes[k, q] * ahead[q]
            r += axes[k, q] * right[q]
            d += axes[k, q] * down[q]
            e -= axes[k, q] * rel[q]
        rays[0, k] = e
        rays[1, k] = a + u0 * r + v0 * d
        rays[2, k] = r / focal
        rays[3, k] = d / focal


@kernel
def _light(
    boxes: Boxes, b: int, axes: Float64, look: WeatherLook, eye: Float32, faces: Float32
) -> None:
    """Writes the colours of a box's faces that the camera may see: +x, -x, +y, -y, +z, -z.

    Args:
        boxes: The collected boxes.
        b: Which of them.
        axes: (3, 3) its axes in the world frame.
        look: The light.
        eye: (3,) the camera's place in the box's frame [m].
        faces: (6, 3) written, in levels.
    """
    shines = boxes.material[b] == _LAMP
    for face in range(6):
        sign = 1.0 if face % 2 == 0 else -1.0
        axis = face // 2
        if sign * eye[axis] < 0.0:
            continue  # the camera is on the other side
        toward = 0.0
        for q in range(3):
            toward += sign * axes[axis, q] * look.sun[q]
        # less of the sky is seen by walls, and none from below
        sky = 0.78 + 0.22 * sign * axes[axis, 2]
        for q in range(3):
            light = sky * look.ambient[q] + max(0.0, toward) * look.sun_colour[q]
            light = 1.0 if shines else light
            faces[face, q] = 255.0 * min(1.0, boxes.colour[b, q] * light)
