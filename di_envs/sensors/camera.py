# mypy: disallow_untyped_defs=False
"""Pinhole cameras: RGB, depth, semantic and instance images of the scene in one pass.

An image is filled row by row. Without roll a row of the ground plane lies at one depth, so its
texels lie on a line; boxes are tested only on the spans of the rows that they may cover. What a
row shows is then coloured in runs of pixels of one face. See `docs/conventions.md` for frames.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.bundles import by_reference
from di_envs.kernels import bind, kernel
from di_envs.sensors.boxes import Boxes, Material
from di_envs.sensors.camera_config import CameraConfig, Rig
from di_envs.sensors.drops import add_glow, add_rain
from di_envs.sensors.projection import (
    Projected,
    place_camera,
    project_boxes,
    project_shadows,
    projected_buffer,
)
from di_envs.sensors.scene import Scene, box_buffer, collect_boxes, scene_of
from di_envs.sensors.spans import (
    blend,
    fill,
    flat,
    haze_span,
    headlights,
    hit_box,
    light_ground,
    line,
    mottle,
    multiply,
    puddles,
    sample,
    shade_span,
    store_row,
    windows,
)
from di_envs.sensors.surfaces import LEVELS, TEXEL_M
from di_envs.sensors.tags import Tag
from di_envs.sensors.weather import Look, Weather, look_of
from di_envs.town.town import Town
from di_envs.world.state import State
from di_envs.world.world import WorldView

FAR_M = 1000.0  # depth of the sky
RANGE_M = 220.0  # boxes further from the ego are not seen
_TAPS = 6  # samples along the road for a row that is far longer than wide
_PLAIN, _WINDOWS, _DECK = int(Material.PLAIN), int(Material.WINDOWS), int(Material.DECK)
_FOLIAGE, _LAMP = int(Material.FOLIAGE), int(Material.LAMP)
_SKY = int(Tag.SKY)
F = np.float32


@by_reference
class Canvas(NamedTuple):
    """One camera's images, and the row that is being worked on."""

    mount: NDArray[np.float64]  # (9,) see place_camera
    cam: NDArray[np.float64]  # (16,) its numbers at the moment
    rgb: NDArray[np.uint8]  # (H, 3 W)
    depth: NDArray[np.float32]  # (H, W)
    tag: NDArray[np.uint8]  # (H, W), or (1, W) where it is not asked for
    instance: NDArray[np.int32]  # alike
    red: NDArray[np.float32]  # (W,)
    green: NDArray[np.float32]
    blue: NDArray[np.float32]
    u: NDArray[np.float32]  # places in the raster
    v: NDArray[np.float32]
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


@kernel
def render(studio, canvas, ego, number):
    """Takes the images of one camera.

    Args:
        studio: `Studio`; its boxes were collected before.
        canvas: `Canvas` of the camera, written.
        ego: The ego's index.
        number: The camera's number, for its own rain.
    """
    height, width = canvas.depth.shape
    scene, look, seen = studio.scene, studio.look, studio.seen
    place_camera(studio.state, ego, canvas.mount, canvas.cam)
    project_boxes(canvas.cam, studio.boxes, look, width, height, seen)
    project_shadows(canvas.cam, studio.boxes, look, scene.base_z[0], seen)
    for y in range(height):
        _row(studio, canvas, y)
    add_glow(studio.boxes, seen, canvas.cam, canvas.depth, canvas.rgb)
    if look.numbers[4] > 0.0:
        add_rain(studio.state, number, look.numbers[4], canvas.rgb)


@kernel
def _row(studio, canvas, y):
    """Takes one row of pixels."""
    cam, seen, boxes, look = canvas.cam, studio.seen, studio.boxes, studio.look
    depth = canvas.depth[y]
    width = depth.shape[0]
    v = (y + 0.5 - cam[14]) / cam[12]
    drop = cam[5] + v * cam[11]  # of the ray, upwards, for 1 ahead
    above = cam[2] - studio.scene.base_z[0]
    far = -above / drop if drop < -1e-6 else FAR_M
    fill(canvas.red, F(0.0))
    fill(canvas.green, F(0.0))
    fill(canvas.blue, F(0.0))
    if 0.0 < far < FAR_M:
        fill(depth, F(far))
        _ground_row(studio, canvas, v, far, drop)
    else:
        fill(depth, F(FAR_M))
        _sky_row(canvas, look, drop)
    low, high = width, 0
    fill(canvas.code, np.int32(-1))
    for k in range(seen.count[0]):
        if y < seen.rect[k, 2] or y >= seen.rect[k, 3]:
            continue
        a, b = seen.rect[k, 0], seen.rect[k, 1]
        ray, half = seen.ray[k], boxes.half[seen.source[k]]
        row = F(y)
        hit_box(
            depth[a:b], canvas.code[a:b], F(a), np.int32(6 * k),
            ray[0], ray[1], ray[2],
            ray[3] + row * ray[9], ray[4] + row * ray[10], ray[5] + row * ray[11],
            ray[6], ray[7], ray[8], half[0], half[1], half[2],
        )  # fmt: skip
        low, high = min(low, a), max(high, b)
    tag = canvas.tag[y] if canvas.tag.shape[0] > 1 else canvas.tag[0]
    who = canvas.instance[y] if canvas.instance.shape[0] > 1 else canvas.instance[0]
    for x in range(width):
        tag[x] = canvas.last[x] & np.uint8(31)
    fill(who, np.int32(0))
    x = low
    while x < high:
        code = canvas.code[x]
        end = x + 1
        while end < high and canvas.code[end] == code:
            end += 1
        if code >= 0:
            _face(studio, canvas, code, x, end, y)
            source = seen.source[code // 6]
            if boxes.material[source] != _DECK or code % 6 != 4:
                fill(tag[x:end], boxes.tag[source])
            else:
                for i in range(x, end):
                    tag[i] = canvas.last[i] & np.uint8(31)
            fill(who[x:end], boxes.instance[source])
        x = end
    if cam[15] > 0.0 and look.numbers[5] > 0.0:
        u0, du = F((0.5 - cam[13]) / cam[12]), F(1.0 / cam[12])
        gain = F(6.0 * cam[15])
        headlights(canvas.red, depth, gain, u0, du)
        headlights(canvas.green, depth, gain, u0, du)
        headlights(canvas.blue, depth, gain, u0, du)
    store_row(canvas.red, canvas.green, canvas.blue, canvas.rgb[y])


@kernel
def _sky_row(canvas, look, drop):
    """Colours a row of sky, from the horizon up."""
    k = min(max(drop * 1.1, 0.0), 1.0)
    k = k * (2.0 - k)
    fill(canvas.red, F(255.0 * (look.horizon[0] + (look.zenith[0] - look.horizon[0]) * k)))
    fill(canvas.green, F(255.0 * (look.horizon[1] + (look.zenith[1] - look.horizon[1]) * k)))
    fill(canvas.blue, F(255.0 * (look.horizon[2] + (look.zenith[2] - look.horizon[2]) * k)))
    fill(canvas.last, np.uint8(_SKY))


@kernel
def _ground_row(studio, canvas, v, far, drop):
    """Colours a row of the ground plane, all of it `far` ahead."""
    cam, look, raster = canvas.cam, studio.look, studio.scene.ground
    focal = cam[12]
    wide = far / focal  # metres across a pixel
    long = wide * math.sqrt((cam[3] + v * cam[9]) ** 2 + (cam[4] + v * cam[10]) ** 2) / -drop
    taps = int(min(max(math.floor(long / wide + 0.5), 1.0), _TAPS * 1.0))
    level = _level(max(wide, long / taps))
    u0 = (0.5 - cam[13]) / focal
    for tap in range(taps):
        vt = v + ((tap + 0.5) / taps - 0.5) / focal
        fall = cam[5] + vt * cam[11]
        if fall > -1e-6:
            fall = -1e-6
        t = min((cam[2] - studio.scene.base_z[0]) / -fall, FAR_M)
        x = cam[0] + t * (cam[3] + u0 * cam[6] + vt * cam[9]) - raster.origin[0]
        y = cam[1] + t * (cam[4] + u0 * cam[7] + vt * cam[10]) - raster.origin[1]
        line(canvas.u, F(x / TEXEL_M), F(t * cam[6] / focal / TEXEL_M))
        line(canvas.v, F(y / TEXEL_M), F(t * cam[7] / focal / TEXEL_M))
        _sample(raster, level, canvas, 0, canvas.u.shape[0], 1.0 / taps)
    _shadow_row(studio, canvas, v, far)
    _ground_light(canvas, look, far, drop)


@kernel
def _level(footprint_m):
    """Level of a raster whose texels are about as large as a footprint."""
    level = math.floor(math.log2(max(footprint_m / TEXEL_M, 1e-3)) + 0.6)
    return min(max(level, 0), LEVELS - 1)


@kernel
def _sample(raster, level, canvas, a, b, weight):
    """Adds samples of a raster at the row's places to columns [a, b)."""
    sample(
        canvas.u[a:b], canvas.v[a:b], canvas.red[a:b], canvas.green[a:b], canvas.blue[a:b],
        canvas.last[a:b], raster.texels, raster.start[level], raster.width[level],
        raster.height[level], F(1.0 / (1 << level)), F(weight),
    )  # fmt: skip


@kernel
def _shadow_row(studio, canvas, v, far):
    """Marks which pixels of a row of ground lie in shadow."""
    cam, seen = canvas.cam, studio.seen
    fill(canvas.shadow, F(0.0))
    width = canvas.shadow.shape[0]
    focal = cam[12]
    u0 = (0.5 - cam[13]) / focal
    x0 = far * (cam[3] + u0 * cam[6] + v * cam[9])
    y0 = far * (cam[4] + u0 * cam[7] + v * cam[10])
    dx, dy = far * cam[6] / focal, far * cam[7] / focal
    flat_m = far * math.hypot(cam[3] + v * cam[9], cam[4] + v * cam[10])
    for k in range(seen.count[1]):
        row = seen.shadow[k]
        if flat_m < row[12] or flat_m > row[13]:
            continue
        start, end = -0.5, width - 0.5
        for strip in range(3):
            at = row[4 * strip] * x0 + row[4 * strip + 1] * y0
            step = row[4 * strip] * dx + row[4 * strip + 1] * dy
            if abs(step) < 1e-9:
                if at < row[4 * strip + 2] or at > row[4 * strip + 3]:
                    end = -1e9
                continue
            a, b = (row[4 * strip + 2] - at) / step, (row[4 * strip + 3] - at) / step
            start, end = max(start, min(a, b)), min(end, max(a, b))
        if end > start:
            first = max(0, math.floor(start))
            stop = min(width, math.ceil(end) + 1)
            shade_span(canvas.shadow[first:stop], F(first), F(start), F(end))


@kernel
def _ground_light(canvas, look, far, drop):
    """Lights a row of ground, wets it, and hides it in haze."""
    numbers = look.numbers
    k = numbers[0] * far
    clear = 1.0 / (1.0 + k + 0.5 * k * k)
    steep = min(1.0, -drop)
    graze = (1.0 - steep) ** 3
    mirror = numbers[2] * 0.5 * graze
    dim = (1.0 - 0.38 * numbers[2]) * (1.0 - mirror) * clear
    for q in range(3):
        sun = look.sun_colour[q] * look.sun[2]
        lit = dim * (look.ambient[q] + sun)
        dark = dim * (0.70 * look.ambient[q] + sun * (1.0 - numbers[1]))
        sky = 255.0 * (look.horizon[q] * (1.0 - steep) + look.zenith[q] * steep)
        add = 255.0 * look.horizon[q] * (1.0 - clear) + sky * mirror * clear
        channel = canvas.red if q == 0 else (canvas.green if q == 1 else canvas.blue)
        light_ground(channel, canvas.shadow, F(lit), F(dark), F(add))
    if numbers[3] > 0.0:
        share = F((0.25 + 0.6 * graze) * clear)
        puddles(
            canvas.last, canvas.red, canvas.green, canvas.blue,
            np.uint8(4.2 * numbers[3] + 0.8), share,
            F(235.0 * look.horizon[0]), F(235.0 * look.horizon[1]), F(235.0 * look.horizon[2]),
        )  # fmt: skip


@kernel
def _face(studio, canvas, code, a, b, y):
    """Colours the pixels [a, b) of a row, all of one face."""
    seen, look, cam = studio.seen, studio.look, canvas.cam
    source = seen.source[code // 6]
    depth = canvas.depth[y, a:b]
    material = studio.boxes.material[source]
    face = code % 6
    haze = F(look.numbers[0])
    if material == _LAMP:
        haze = F(0.25) * haze
    red, green, blue = canvas.red[a:b], canvas.green[a:b], canvas.blue[a:b]
    if material == _DECK and face == 4:
        _deck(studio, canvas, code, a, b, y)
        return
    sky_r, sky_g, sky_b = (
        F(255.0 * look.horizon[0]),
        F(255.0 * look.horizon[1]),
        F(255.0 * look.horizon[2]),
    )
    colour = seen.faces[code]
    flat(red, depth, haze, colour[0], sky_r)
    flat(green, depth, haze, colour[1], sky_g)
    flat(blue, depth, haze, colour[2], sky_b)
    if material != _WINDOWS and material != _FOLIAGE:
        return
    ray = seen.ray[code // 6]
    row, first, pixel = F(y), F(a), F(1.0 / cam[12])
    pattern = canvas.u[a:b]
    side = 1 if face < 2 else 0
    qa, pa = ray[3 + side] + row * ray[9 + side], ray[5] + row * ray[11]
    if material == _WINDOWS and face < 4:
        windows(pattern, depth, first, ray[side], qa, ray[6 + side], ray[2], pa, ray[8], pixel)
        glow = F(255.0 * look.numbers[7])
        blend(red, pattern, F(0.13) * sky_r + F(12.0) + F(0.62) * glow)
        blend(green, pattern, F(0.15) * sky_g + F(14.0) + F(0.48) * glow)
        blend(blue, pattern, F(0.18) * sky_b + F(18.0) + F(0.25) * glow)
    elif material == _FOLIAGE:
        other = 1 - side
        sa = ray[3 + other] + row * ray[9 + other]
        mottle(
            pattern, depth, first, ray[side], qa, ray[6 + side], ray[2], pa, ray[8],
            ray[other], sa, ray[6 + other], pixel,
        )  # fmt: skip
        multiply(red, pattern)
        multiply(green, pattern)
        multiply(blue, pattern)


@kernel
def _deck(studio, canvas, code, a, b, y):
    """Colours the top of a deck by the raster of what is elevated."""
    seen, look, cam, raster = studio.seen, studio.look, canvas.cam, studio.scene.deck
    depth = canvas.depth[y, a:b]
    ray = seen.ray[code // 6]
    focal = cam[12]
    v = (y + 0.5 - cam[14]) / focal
    over = max(0.2, ray[2] - studio.boxes.half[seen.source[code // 6], 2])
    middle = np.float64(depth[(b - a) // 2])
    wide = middle / focal
    long = wide * max(1.0, middle / over)
    level = _level(math.sqrt(wide * long))
    fx, fy = cam[3] + v * cam[9], cam[4] + v * cam[10]
    for x in range(b - a):
        across = (a + x + 0.5 - cam[13]) / focal
        z = np.float64(depth[x])
        canvas.u[a + x] = (cam[0] + z * (fx + across * cam[6]) - raster.origin[0]) / TEXEL_M
        canvas.v[a + x] = (cam[1] + z * (fy + across * cam[7]) - raster.origin[1]) / TEXEL_M
    for q in range(3):
        channel = canvas.red if q == 0 else (canvas.green if q == 1 else canvas.blue)
        fill(channel[a:b], F(0.0))
    _sample(raster, level, canvas, a, b, 1.0)
    wet = 1.0 - 0.38 * look.numbers[2]
    for q in range(3):
        channel = canvas.red if q == 0 else (canvas.green if q == 1 else canvas.blue)
        light = wet * (look.ambient[q] + look.sun_colour[q] * look.sun[2])
        haze_span(channel[a:b], depth, F(look.numbers[0]), F(light), F(255.0 * look.horizon[q]))


class CameraRig:
    """Some cameras on an ego. Keeps no memory: only buffers and static tables."""

    def __init__(self, town: Town, rig: Rig, weather: Weather, ego: int = 0) -> None:
        """Builds the town's scene, unless that was done before.

        Args:
            town: The town.
            rig: Its cameras.
            weather: The weather that they see.
            ego: Index of the ego that carries them.
        """
        self.rig = rig
        self._ego = ego
        self._scene = scene_of(town)
        self._look = look_of(weather)
        self._boxes, self._seen = box_buffer(), projected_buffer()

    def start(self, view: WorldView) -> None:
        """Takes up an episode: the view's state arrays."""
        self._studio = Studio(
            state=view.state,
            scene=self._scene,
            look=self._look,
            boxes=self._boxes,
            seen=self._seen,
        )
        canvas = _canvas(self.rig.cameras[0], self.rig)
        self._collect = bind(
            collect_boxes, self._scene, view.state, self._ego, RANGE_M, self._boxes
        )
        self._render = bind(render, self._studio, canvas, self._ego, 0)

    def observe(self) -> dict[str, NDArray[Any]]:
        """The present images; every array is a fresh one."""
        self._collect(self._scene, self._studio.state, self._ego, RANGE_M, self._boxes)
        images: dict[str, NDArray[Any]] = {}
        for number, camera in enumerate(self.rig.cameras):
            canvas = _canvas(camera, self.rig)
            self._render(self._studio, canvas, self._ego, number)
            images[camera.name] = canvas.rgb.reshape(camera.height, camera.width, 3)
            if self.rig.depth:
                images[f"{camera.name}_depth"] = canvas.depth
            if self.rig.semantic:
                images[f"{camera.name}_semantic"] = canvas.tag
            if self.rig.instance:
                images[f"{camera.name}_instance"] = canvas.instance
        return images


def _canvas(camera: CameraConfig, rig: Rig) -> Canvas:
    height, width = camera.height, camera.width
    beam = max(0.0, math.cos(camera.yaw_rad))
    mount = (
        camera.x_m, camera.y_m, camera.z_m, camera.yaw_rad, camera.pitch_rad,
        camera.focal_px, width / 2.0, height / 2.0, beam,
    )  # fmt: skip
    rows = [np.zeros(width, np.float32) for _ in range(6)]
    # one row is enough of what nobody asks for; two rows tell an image from that
    return Canvas(
        mount=np.array(mount, np.float64),
        cam=np.zeros(16),
        rgb=np.zeros((height, 3 * width), np.uint8),
        depth=np.zeros((height, width), np.float32),
        tag=np.zeros((height if rig.semantic else 1, width), np.uint8),
        instance=np.zeros((height if rig.instance else 1, width), np.int32),
        red=rows[0],
        green=rows[1],
        blue=rows[2],
        u=rows[3],
        v=rows[4],
        shadow=rows[5],
        last=np.zeros(width, np.uint8),
        code=np.zeros(width, np.int32),
    )
