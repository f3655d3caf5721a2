"""Boxes as a camera sees them: the pixels they may cover, their rays, the light on their faces."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.sensors.scene.boxes import Material
from di_envs.sensors.scene.scene import ROOM

NEAR = 0.1  # m; nothing nearer is seen
SMALLEST_PX = 0.7  # boxes that look smaller are left out, unless they shine
SHADOW_RANGE_M = 90.0
_GROWN_PX = 0.02  # a ray is traced in single precision: it may meet a box by a hair beside it
_LAMP_GROWN_PX = 1.0  # a lamp blooms where it covers no pixel's middle
_LAMP = int(Material.LAMP)

# Columns of a camera's numbers: where it is, its axes ahead, right and down, and its intrinsics
EYE, AHEAD, RIGHT, DOWN, FOCAL, CX, CY, BEAM = 0, 3, 6, 9, 12, 13, 14, 15


@by_reference
class Projected(NamedTuple):
    """The V boxes that one camera sees, in the order of the collection, and shadows."""

    count: NDArray[np.int64]  # type: ignore[assignment]  # (2,) boxes, shadows
    source: NDArray[np.int32]  # (V,) index among the collected boxes
    rect: NDArray[np.int32]  # (V, 4) first and end column, first and end row
    ray: NDArray[np.float32]  # (V, 12) camera in the box's frame, ray of pixel (0, 0), and steps
    faces: NDArray[np.float32]  # (6 V, 3) colours in levels
    shadow: NDArray[np.float64]  # (S, 16) see add_shadow


def projected_buffer() -> Projected:
    """Room for what `project_boxes` finds."""
    return Projected(
        count=np.zeros(2, np.int64),
        source=np.zeros(ROOM, np.int32),
        rect=np.zeros((ROOM, 4), np.int32),
        ray=np.zeros((ROOM, 12), np.float32),
        faces=np.zeros((6 * ROOM, 3), np.float32),
        shadow=np.zeros((ROOM, 16)),
    )


@kernel
def place_camera(state, ego, mount, cam):
    """Writes a camera's numbers from the ego's pose.

    Args:
        state: `State` of the world.
        ego: The ego's index.
        mount: (9,) x, y, z, yaw, pitch in the ego's frame, focal length, cx, cy, headlights 0..1.
        cam: (16,) written.
    """
    c, s = math.cos(state.yaw[ego]), math.sin(state.yaw[ego])
    cam[0] = state.x[ego] + c * mount[0] - s * mount[1]
    cam[1] = state.y[ego] + s * mount[0] + c * mount[1]
    cam[2] = state.z[ego] + mount[2]
    yaw, pitch = state.yaw[ego] + mount[3], mount[4]
    c, s, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    cam[3], cam[4], cam[5] = c * cp, s * cp, sp
    cam[6], cam[7], cam[8] = -s, c, 0.0
    cam[9], cam[10], cam[11] = c * sp, s * sp, -cp
    cam[12], cam[13], cam[14], cam[15] = mount[5], mount[6], mount[7], mount[8]


@kernel
def project_boxes(cam, boxes, look, width, height, out):
    """Finds the boxes that a camera sees and prepares their rays and colours."""
    out.count[0] = 0
    axes = np.zeros((3, 3))
    focal = cam[12]
    rel = np.zeros(3)
    in_cam = np.zeros((4, 3))  # middle, then the three half sides: ahead, right, down
    for b in range(boxes.count[0]):
        radius2 = 0.0
        for k in range(3):
            rel[k] = boxes.centre[b, k] - cam[k]
            radius2 += np.float64(boxes.half[b, k]) * np.float64(boxes.half[b, k])
        radius = math.sqrt(radius2)
        ahead = rel[0] * cam[3] + rel[1] * cam[4] + rel[2] * cam[5]
        if ahead + radius < NEAR:
            continue
        if radius * focal < SMALLEST_PX * ahead and boxes.material[b] != _LAMP:
            continue
        _axes_of(boxes, b, axes)
        for k in range(3):
            at = 3 + 3 * k
            in_cam[0, k] = rel[0] * cam[at] + rel[1] * cam[at + 1] + rel[2] * cam[at + 2]
            for side in range(3):
                dot = 0.0
                for q in range(3):
                    dot += axes[side, q] * cam[at + q]
                in_cam[1 + side, k] = dot * boxes.half[b, side]
        v = out.count[0]
        grown = _LAMP_GROWN_PX if boxes.material[b] == _LAMP else _GROWN_PX
        if _bounds(in_cam, cam, width, height, grown, out.rect[v]):
            out.source[v] = b
            _rays(rel, axes, cam, out.ray[v])
            _light(boxes, b, axes, look, out.ray[v], out.faces[6 * v : 6 * v + 6])
            out.count[0] = v + 1


@kernel
def _axes_of(boxes, b, axes):
    """Writes a box's axes ahead, right and up in the world frame."""
    yaw, pitch = np.float64(boxes.yaw[b]), np.float64(boxes.pitch[b])
    c, s = math.cos(yaw), math.sin(yaw)
    cp, sp = 1.0, 0.0
    if pitch != 0.0:
        cp, sp = math.cos(pitch), math.sin(pitch)
    axes[0, 0], axes[0, 1], axes[0, 2] = c * cp, s * cp, sp
    axes[1, 0], axes[1, 1], axes[1, 2] = -s, c, 0.0
    axes[2, 0], axes[2, 1], axes[2, 2] = -c * sp, -s * sp, cp


@kernel
def _bounds(box, cam, width, height, grown, rect):
    """Writes the pixels whose middles a box may cover; False if there are none.

    Args:
        box: (4, 3) its middle and half sides, ahead, right and down of the camera; what is nearer
            than the near plane is cut off.
        cam: (16,) the camera's numbers.
        width, height: Of the image.
        grown: Pixels by which the box counts as larger on each side.
        rect: (4,) written.
    """
    focal, cx, cy = cam[12], cam[13], cam[14]
    low_x, high_x, low_y, high_y = 1e9, -1e9, 1e9, -1e9
    for corner in range(8):
        a = 1.0 if corner & 1 else -1.0
        r = 1.0 if corner & 2 else -1.0
        u = 1.0 if corner & 4 else -1.0
        z = box[0, 0] + a * box[1, 0] + r * box[2, 0] + u * box[3, 0]
        x = box[0, 1] + a * box[1, 1] + r * box[2, 1] + u * box[3, 1]
        y = box[0, 2] + a * box[1, 2] + r * box[2, 2] + u * box[3, 2]
        if z >= NEAR:
            low_x, high_x = min(low_x, x / z), max(high_x, x / z)
            low_y, high_y = min(low_y, y / z), max(high_y, y / z)
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
def _rays(rel, axes, cam, ray):
    """Writes the camera in the box's frame, the ray of pixel (0, 0)'s middle, and its steps."""
    focal = cam[12]
    u0, v0 = (0.5 - cam[13]) / focal, (0.5 - cam[14]) / focal
    for k in range(3):
        a, r, d, e = 0.0, 0.0, 0.0, 0.0
        for q in range(3):
            a += axes[k, q] * cam[3 + q]
            r += axes[k, q] * cam[6 + q]
            d += axes[k, q] * cam[9 + q]
            e -= axes[k, q] * rel[q]
        ray[k] = e
        ray[3 + k] = a + u0 * r + v0 * d
        ray[6 + k] = r / focal
        ray[9 + k] = d / focal


@kernel
def _light(boxes, b, axes, look, ray, faces):
    """Writes the colours of a box's faces that the camera may see: +x, -x, +y, -y, +z, -z."""
    shines = boxes.material[b] == _LAMP
    for face in range(6):
        sign = 1.0 if face % 2 == 0 else -1.0
        axis = face // 2
        if sign * ray[axis] < 0.0:
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


@kernel
def project_shadows(cam, boxes, look, base_z, out):
    """Prepares the shadows that boxes cast on the plane, as what three strips have in common.

    A row of `out.shadow` holds, for each strip, its normal (x, y), its least and greatest value
    along it, then the least and greatest way ahead of the camera, and its least width.
    """
    out.count[1] = 0
    sun_x, sun_y, sun_z = np.float64(look.sun[0]), np.float64(look.sun[1]), np.float64(look.sun[2])
    # without much of a sun, a shadow is just the dark below
    slope = 1.0 / sun_z if look.numbers[1] > 0.35 else 0.0
    fall_x, fall_y = -sun_x * slope, -sun_y * slope
    fall = math.hypot(fall_x, fall_y)
    for b in range(boxes.count[0]):
        hx, hy, hz = (
            np.float64(boxes.half[b, 0]),
            np.float64(boxes.half[b, 1]),
            np.float64(boxes.half[b, 2]),
        )
        if hz < 0.3 and (hx < 0.3 or hy < 0.3) and boxes.centre[b, 2] - base_z < 4.0:
            continue
        dx, dy = boxes.centre[b, 0] - cam[0], boxes.centre[b, 1] - cam[1]
        reach = SHADOW_RANGE_M + hx + hy
        bottom = max(0.0, boxes.centre[b, 2] - hz - base_z)
        top = boxes.centre[b, 2] + hz - base_z
        if dx * dx + dy * dy > reach * reach or top <= 0.0 or (slope == 0.0 and bottom > 1.5):
            continue
        row = out.shadow[out.count[1]]
        _shadow(cam, boxes, b, hx, hy, bottom, top, fall_x, fall_y, fall, row)
        if row[13] > NEAR:
            out.count[1] += 1


@kernel
def _shadow(cam, boxes, b, hx, hy, bottom, top, fall_x, fall_y, fall, row):
    """Writes one shadow, relative to the camera's place."""
    c, s = math.cos(np.float64(boxes.yaw[b])), math.sin(np.float64(boxes.yaw[b]))
    x = boxes.centre[b, 0] - cam[0] + fall_x * bottom
    y = boxes.centre[b, 1] - cam[1] + fall_y * bottom
    long_x, long_y = fall_x * (top - bottom), fall_y * (top - bottom)
    for strip in range(3):
        if strip == 0:
            nx, ny, half, add = c, s, hx, c * long_x + s * long_y
        elif strip == 1:
            nx, ny, half, add = -s, c, hy, c * long_y - s * long_x
        elif fall > 0.0:
            nx, ny, add = -fall_y / fall, fall_x / fall, 0.0
            half = abs(nx * c + ny * s) * hx + abs(ny * c - nx * s) * hy
        else:
            nx, ny, half, add = c, s, hx, 0.0
        middle = nx * x + ny * y
        row[4 * strip] = nx
        row[4 * strip + 1] = ny
        row[4 * strip + 2] = middle - half + min(0.0, add)
        row[4 * strip + 3] = middle + half + max(0.0, add)
    flat = math.hypot(cam[3], cam[4])
    fx, fy = cam[3] / flat, cam[4] / flat
    half = abs(fx * c + fy * s) * hx + abs(fy * c - fx * s) * hy
    near, add = fx * x + fy * y, fx * long_x + fy * long_y
    row[14] = 2.0 * min(row[3] - row[2], row[7] - row[6])  # how wide it is at least
    row[12] = near - half + min(0.0, add)
    row[13] = near + half + max(0.0, add)
