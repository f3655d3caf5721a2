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
    last_bytes,
    light_ground,
    mottle,
    multiply,
    plane_points,
    puddles,
    sample,
    shade_span,
    spread,
    store_row,
    tags_of,
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
_TAPS = 3  # samples along the road for a row that is far longer than wide
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
    tag: NDArray[np.uint8]  # (H, W), or (0, W) where it is not asked for
    instance: NDArray[np.int32]  # alike
    red: NDArray[np.float32]  # (W,)
    green: NDArray[np.float32]
    blue: NDArray[np.float32]
    u: NDArray[np.float32]  # places in the raster
    v: NDArray[np.float32]
    samples: NDArray[np.float32]  # (3, W + 2) before they are spread
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
    start, boxes = _rows_of_boxes(seen, height)
    for y in range(height):
        _row(studio, canvas, y, boxes[start[y] : start[y + 1]])
    add_glow(studio.boxes, seen, canvas.cam, canvas.depth, canvas.rgb)
    if look.numbers[4] > 0.0:
        add_rain(studio.state, number, look.numbers[4], canvas.rgb)


@kernel
def _rows_of_boxes(seen, height):
    """Which boxes each row has to test: row y those from start[y] to start[y + 1]."""
    start = np.zeros(height + 1, np.int64)
    for k in range(seen.count[0]):
        for y in range(seen.rect[k, 2], seen.rect[k, 3]):
            start[y + 1] += 1
    for y in range(height):
        start[y + 1] += start[y]
    boxes = np.empty(start[height], np.int32)
    filled = start.copy()
    for k in range(seen.count[0]):
        for y in range(seen.rect[k, 2], seen.rect[k, 3]):
            boxes[filled[y]] = k
            filled[y] += 1
    return start, boxes


@kernel
def _row(studio, canvas, y, boxes):
    """Takes one row of pixels, on which these boxes may be."""
    cam, seen, look = canvas.cam, studio.seen, studio.look
    depth = canvas.depth[y]
    v = (y + 0.5 - cam[14]) / cam[12]
    drop = cam[5] + v * cam[11]  # of the ray, upwards, for 1 ahead
    above = cam[2] - studio.scene.base_z[0]
    far = -above / drop if drop < -1e-6 else FAR_M
    ground = 0.0 < far < FAR_M
    fill(depth, F(far if ground else FAR_M))
    fill(canvas.code, np.int32(-1))
    low, high = _hit_boxes(studio, canvas, y, boxes)
    if ground:
        _shadow_row(studio, canvas, v, far)
    with_tag, with_who = canvas.tag.shape[0] > 0, canvas.instance.shape[0] > 0
    tag = canvas.tag[y] if with_tag else canvas.last
    who = canvas.instance[y] if with_who else canvas.code
    x, width = 0, depth.shape[0]
    while x < width:
        code = canvas.code[x]
        end = low if x < low else (x + 1 if x < high else width)
        while end < high and canvas.code[end] == code:
            end += 1
        if code < 0:
            if with_who:
                fill(who[x:end], np.int32(0))
            if ground:
                _ground(studio, canvas, x, end, y, v, far, drop, tag)
            else:
                _sky(canvas, look, x, end, drop)
                if with_tag:
                    fill(tag[x:end], np.uint8(_SKY))
        else:
            source = seen.source[code // 6]
            if with_who:
                fill(who[x:end], studio.boxes.instance[source])
            if with_tag:
                fill(tag[x:end], studio.boxes.tag[source])
            _face(studio, canvas, code, x, end, y, tag)
        x = end
    if cam[15] > 0.0 and look.numbers[5] > 0.0:
        u0, du = F((0.5 - cam[13]) / cam[12]), F(1.0 / cam[12])
        gain = F(6.0 * cam[15])
        headlights(canvas.red, depth, gain, u0, du)
        headlights(canvas.green, depth, gain, u0, du)
        headlights(canvas.blue, depth, gain, u0, du)
    store_row(canvas.red, canvas.green, canvas.blue, canvas.rgb[y])


@kernel
def _hit_boxes(studio, canvas, y, boxes):
    """Finds the nearest face at each pixel of a row; returns the columns that boxes may cover."""
    seen, row = studio.seen, F(y)
    low, high = canvas.code.shape[0], 0
    depth = canvas.depth[y]
    for n in range(boxes.shape[0]):
        k = boxes[n]
        a, b = seen.rect[k, 0], seen.rect[k, 1]
        low, high = min(low, a), max(high, b)
        ray, half = seen.ray[k], studio.boxes.half[seen.source[k]]
        hit_box(
            depth[a:b], canvas.code[a:b], F(a), np.int32(6 * k),
            ray[0], ray[1], ray[2],
            ray[3] + row * ray[9], ray[4] + row * ray[10], ray[5] + row * ray[11],
            ray[6], ray[7], ray[8], half[0], half[1], half[2],
        )  # fmt: skip
    return low, high


@kernel
def _sky(canvas, look, a, b, drop):
    """Colours a span of sky, by how far above the horizon it is."""
    up = max(0.0, drop) / math.sqrt(1.0 + drop * drop)
    k = 1.4 * up / (0.4 + up)
    for q in range(3):
        channel = canvas.red if q == 0 else (canvas.green if q == 1 else canvas.blue)
        fill(channel[a:b], F(255.0 * (look.horizon[q] + (look.zenith[q] - look.horizon[q]) * k)))


@kernel
def _texture(canvas, raster, a, b, y, over, with_last):
    """Colours a span by a raster that lies level, `over` metres below the camera.

    Where a texel is wider than some pixels, only every second, fourth or eighth is sampled and
    those between are filled in. Where a pixel is longer than wide, several samples are taken.
    """
    cam = canvas.cam
    focal = cam[12]
    v = (y + 0.5 - cam[14]) / focal
    depth = canvas.depth[y, a:b]
    middle = np.float64(depth[(b - a) // 2])
    gx, gy = cam[3] + v * cam[9], cam[4] + v * cam[10]
    flat_m = math.hypot(gx, gy)
    wide = middle / focal
    long = wide * max(1.0, middle * flat_m / over)
    taps = int(min(max(math.floor(long / wide * 0.5), 1.0), _TAPS * 1.0))
    level = _level(max(wide, long / taps))
    stride = 1
    while stride < 8 and wide * stride * 3.0 <= TEXEL_M * (1 << level):
        stride *= 2
    n = b - a if stride == 1 else (b - a - 1) // stride + 2
    u, w = canvas.u[:n], canvas.v[:n]
    red, green, blue = canvas.samples[0, :n], canvas.samples[1, :n], canvas.samples[2, :n]
    if stride == 1:
        red, green, blue = canvas.red[a:b], canvas.green[a:b], canvas.blue[a:b]
    fill(red, F(0.0))
    fill(green, F(0.0))
    fill(blue, F(0.0))
    u0 = (0.5 - cam[13]) / focal
    x0, y0 = cam[0] - raster.origin[0], cam[1] - raster.origin[1]
    for tap in range(taps):
        shift = ((tap + 0.5) / taps - 0.5) * long / flat_m
        _places(canvas, u, depth, stride, (x0 + shift * gx, gx + u0 * cam[6], cam[6]), a)
        _places(canvas, w, depth, stride, (y0 + shift * gy, gy + u0 * cam[7], cam[7]), a)
        sample(
            u, w, red, green, blue, raster.texels, raster.start[level], raster.width[level],
            raster.height[level], F(1.0 / (1 << level)), F(1.0 / taps),
        )  # fmt: skip
    if stride > 1:
        spread(red, canvas.red[a:b], stride)
        spread(green, canvas.green[a:b], stride)
        spread(blue, canvas.blue[a:b], stride)
    if with_last:
        u, w = canvas.u[: b - a], canvas.v[: b - a]
        _places(canvas, u, depth, 1, (x0, gx + u0 * cam[6], cam[6]), a)
        _places(canvas, w, depth, 1, (y0, gy + u0 * cam[7], cam[7]), a)
        last_bytes(u, w, canvas.last[a:b], raster.texels, raster.width[0], raster.height[0])


@kernel
def _places(canvas, out, depth, stride, terms, a):
    """Writes places along one axis, in texels: terms are of the camera, of depth, of columns."""
    start, gain, turn = terms
    turn = turn / canvas.cam[12]
    plane_points(out, depth, stride, F(start / TEXEL_M), F(gain / TEXEL_M), F(turn / TEXEL_M), F(a))


@kernel
def _level(footprint_m):
    """Level of a raster whose texels are about as large as a footprint."""
    level = math.floor(math.log2(max(footprint_m / TEXEL_M, 1e-3)) + 0.6)
    return min(max(level, 0), LEVELS - 1)


@kernel
def _ground(studio, canvas, a, b, y, v, far, drop, tag):
    """Colours the pixels [a, b) of a row, all of the ground plane."""
    with_last = canvas.tag.shape[0] > 0 or studio.look.numbers[3] > 0.0
    over = canvas.cam[2] - studio.scene.base_z[0]
    _texture(canvas, studio.scene.ground, a, b, y, over, with_last)
    if with_last:
        if canvas.tag.shape[0] > 0:
            tags_of(canvas.last[a:b], tag[a:b])
    _ground_light(canvas, studio.look, a, b, far, drop)


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
    above = max(0.1, cam[2] - studio.scene.base_z[0])
    long = far / focal * max(1.0, flat_m / above)  # of a pixel, along the road
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
            shade_span(
                canvas.shadow[first:stop], F(first), F(start), F(end), F(min(1.0, row[14] / long))
            )


@kernel
def _ground_light(canvas, look, a, b, far, drop):
    """Lights a span of ground, wets it, and hides it in haze."""
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
        light_ground(channel[a:b], canvas.shadow[a:b], F(lit), F(dark), F(add))
    if numbers[3] > 0.0:
        share = F((0.25 + 0.6 * graze) * clear)
        puddles(
            canvas.last[a:b], canvas.red[a:b], canvas.green[a:b], canvas.blue[a:b],
            np.uint8(3.0 * numbers[3] + 1.0), share,
            F(235.0 * look.horizon[0]), F(235.0 * look.horizon[1]), F(235.0 * look.horizon[2]),
        )  # fmt: skip


@kernel
def _face(studio, canvas, code, a, b, y, tag):
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
        _deck(studio, canvas, code, a, b, y, tag)
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
def _deck(studio, canvas, code, a, b, y, tag):
    """Colours the top of a deck by the raster of what is elevated."""
    seen, look = studio.seen, studio.look
    over = seen.ray[code // 6, 2] - studio.boxes.half[seen.source[code // 6], 2]
    with_last = canvas.tag.shape[0] > 0
    _texture(canvas, studio.scene.deck, a, b, y, max(0.2, np.float64(over)), with_last)
    if with_last:
        tags_of(canvas.last[a:b], tag[a:b])
    wet = 1.0 - 0.38 * look.numbers[2]
    depth = canvas.depth[y, a:b]
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
        self._canvases = [_canvas(camera, self.rig) for camera in self.rig.cameras]
        canvas = self._canvases[0]
        self._collect = bind(
            collect_boxes, self._scene, view.state, self._ego, RANGE_M, self._boxes
        )
        self._render = bind(render, self._studio, canvas, self._ego, 0)

    def observe(self) -> dict[str, NDArray[Any]]:
        """The present images; every array is a fresh one."""
        self._collect(self._scene, self._studio.state, self._ego, RANGE_M, self._boxes)
        images: dict[str, NDArray[Any]] = {}
        for number, camera in enumerate(self.rig.cameras):
            canvas = self._fresh(self._canvases[number])
            self._render(self._studio, canvas, self._ego, number)
            images[camera.name] = canvas.rgb.reshape(camera.height, camera.width, 3)
            if self.rig.depth:
                images[f"{camera.name}_depth"] = canvas.depth
            if self.rig.semantic:
                images[f"{camera.name}_semantic"] = canvas.tag
            if self.rig.instance:
                images[f"{camera.name}_instance"] = canvas.instance
        return images

    def _fresh(self, canvas: Canvas) -> Canvas:
        """The canvas with new arrays for what is handed out; the rest is used again and again."""
        images: dict[str, NDArray[Any]] = {"rgb": np.empty_like(canvas.rgb)}
        if self.rig.depth:
            images["depth"] = np.empty_like(canvas.depth)
        if self.rig.semantic:
            images["tag"] = np.empty_like(canvas.tag)
        if self.rig.instance:
            images["instance"] = np.empty_like(canvas.instance)
        return canvas._replace(**images)


def _canvas(camera: CameraConfig, rig: Rig) -> Canvas:
    height, width = camera.height, camera.width
    beam = max(0.0, math.cos(camera.yaw_rad))
    mount = (
        camera.x_m, camera.y_m, camera.z_m, camera.yaw_rad, camera.pitch_rad,
        camera.focal_px, width / 2.0, height / 2.0, beam,
    )  # fmt: skip
    rows = [np.zeros(width + 2, np.float32) for _ in range(6)]
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
        samples=np.zeros((3, width + 2), np.float32),
        shadow=rows[5][:width],
        last=np.zeros(width, np.uint8),
        code=np.zeros(width, np.int32),
    )
