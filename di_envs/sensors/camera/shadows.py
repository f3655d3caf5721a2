"""The shadows that boxes cast on the ground plane, as a camera sees them.

A shadow is a box moved along the light, seen from above: what three strips of the plane have in
common, two along the box's sides and one along the light.
"""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.arrays import Float64
from di_envs.numerics.kernels import kernel
from di_envs.sensors.camera.config import STEEP_RAD
from di_envs.sensors.camera.projection import NEAR, Camera, Projected
from di_envs.sensors.scene.boxes import Boxes
from di_envs.sensors.weather import WeatherLook

SHADOW_RANGE_M = 90.0


@kernel
def project_shadows(
    cam: Camera, boxes: Boxes, look: WeatherLook, base_z: float, out: Projected
) -> None:
    """Prepares the shadows that boxes cast on the plane at height `base_z` [m]."""
    out.count[1] = 0
    sun_x, sun_y, sun_z = np.float64(look.sun[0]), np.float64(look.sun[1]), np.float64(look.sun[2])
    # without much of a sun, a shadow is just the dark below
    slope = 1.0 / sun_z if look.shadow > 0.35 else 0.0
    fall = (-sun_x * slope, -sun_y * slope)
    for b in range(boxes.count[0]):
        hx, hy, hz = (
            np.float64(boxes.half[b, 0]),
            np.float64(boxes.half[b, 1]),
            np.float64(boxes.half[b, 2]),
        )
        if hz < 0.3 and (hx < 0.3 or hy < 0.3) and boxes.centre[b, 2] - base_z < 4.0:
            continue
        dx, dy = boxes.centre[b, 0] - cam.eye[0], boxes.centre[b, 1] - cam.eye[1]
        reach = SHADOW_RANGE_M + hx + hy
        bottom = max(0.0, boxes.centre[b, 2] - hz - base_z)
        top = boxes.centre[b, 2] + hz - base_z
        if dx * dx + dy * dy > reach * reach or top <= 0.0 or (slope == 0.0 and bottom > 1.5):
            continue
        at = out.count[1]
        _shadow(cam, boxes, b, bottom, top, fall, out.strips[at], out.shadow_m[at])
        if out.shadow_m[at, 1] > NEAR or abs(cam.pitch_rad) > STEEP_RAD:
            out.count[1] += 1


@kernel
def _shadow(
    cam: Camera,
    boxes: Boxes,
    b: int,
    bottom: float,
    top: float,
    fall: tuple[float, float],
    strips: Float64,
    shadow_m: Float64,
) -> None:
    """Writes one shadow, from the camera's place.

    Args:
        cam: In its place.
        boxes: The collected boxes.
        b: Which of them.
        bottom, top: Its height over the plane [m].
        fall: How far x and y of a shadow move for each metre of height.
        strips: (3, 4) written, as in `Projected.strips`.
        shadow_m: (3,) written, as in `Projected.shadow_m`.
    """
    fall_x, fall_y = fall
    steep = math.hypot(fall_x, fall_y)
    hx, hy = np.float64(boxes.half[b, 0]), np.float64(boxes.half[b, 1])
    c, s = boxes.turn[b, 0], boxes.turn[b, 1]
    x = boxes.centre[b, 0] - cam.eye[0] + fall_x * bottom
    y = boxes.centre[b, 1] - cam.eye[1] + fall_y * bottom
    long_x, long_y = fall_x * (top - bottom), fall_y * (top - bottom)
    for strip in range(3):
        if strip == 0:
            nx, ny, half, add = c, s, hx, c * long_x + s * long_y
        elif strip == 1:
            nx, ny, half, add = -s, c, hy, c * long_y - s * long_x
        elif steep > 0.0:
            nx, ny, add = -fall_y / steep, fall_x / steep, 0.0
            half = abs(nx * c + ny * s) * hx + abs(ny * c - nx * s) * hy
        else:
            nx, ny, half, add = c, s, hx, 0.0
        middle = nx * x + ny * y
        strips[strip, 0] = nx
        strips[strip, 1] = ny
        strips[strip, 2] = middle - half + min(0.0, add)
        strips[strip, 3] = middle + half + max(0.0, add)
    flat = math.hypot(cam.ahead[0], cam.ahead[1])
    fx, fy = cam.ahead[0] / flat, cam.ahead[1] / flat
    half = abs(fx * c + fy * s) * hx + abs(fy * c - fx * s) * hy
    near, add = fx * x + fy * y, fx * long_x + fy * long_y
    shadow_m[0] = near - half + min(0.0, add)
    shadow_m[1] = near + half + max(0.0, add)
    shadow_m[2] = 2.0 * min(strips[0, 3] - strips[0, 2], strips[1, 3] - strips[1, 2])
