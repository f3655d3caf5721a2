"""One camera's images, row by row: what each pixel shows, then its colour in runs of one face.

Boxes are tested only on the spans of the rows that they may cover.
"""

from __future__ import annotations

import numpy as np

from di_envs.numerics.arrays import Float32, Int32, Int64
from di_envs.numerics.kernels import kernel
from di_envs.sensors.camera.canvas import Canvas, Studio
from di_envs.sensors.camera.drops import add_glow, add_rain
from di_envs.sensors.camera.face_shading import colour_face, colour_sky
from di_envs.sensors.camera.ground_shading import colour_ground, shade_row
from di_envs.sensors.camera.projection import Projected, place_camera, project_boxes
from di_envs.sensors.camera.runs import mark_ends, run_end
from di_envs.sensors.camera.shadows import project_shadows
from di_envs.sensors.camera.spans import (
    BLOCK,
    BoxRays,
    beam_span,
    copy,
    fill,
    hit_box,
    hit_upright,
    multiply,
    store_row,
    whole,
)
from di_envs.sensors.scene.tags import Tag

FAR_M = 1000.0  # depth of the sky
_SKY = int(Tag.SKY)
F = np.float32


@kernel
def render(studio: Studio, canvas: Canvas, ego: int, key: int) -> None:
    """Takes the images of one camera.

    Args:
        studio: Its boxes were collected before.
        canvas: Of the camera, written.
        ego: The ego's index.
        key: The camera's own, for its own rain.
    """
    height, width = canvas.depth.shape
    scene, look, seen, cam = studio.scene, studio.look, studio.seen, canvas.cam
    place_camera(studio.state, ego, cam)
    project_boxes(cam, studio.boxes, look, width, height, seen)
    project_shadows(cam, studio.boxes, look, scene.base_z[0], seen)
    start, boxes = _rows_of_boxes(seen, height)
    for y in range(height):
        _row(studio, canvas, y, boxes[start[y] : start[y + 1]])
    add_glow(studio.boxes, seen, cam, canvas.depth, canvas.rgb)
    if look.rain > 0.0:
        add_rain(studio.state, key, look.rain, canvas.rgb)


@kernel
def _rows_of_boxes(seen: Projected, height: int) -> tuple[Int64, Int32]:
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
def _row(studio: Studio, canvas: Canvas, y: int, boxes: Int32) -> None:
    """Takes row y of pixels, on which these boxes may be, by their numbers among those seen."""
    cam = canvas.cam
    width = canvas.depth.shape[1]
    depth = canvas.near
    v = (y + 0.5 - cam.cy_px) / cam.focal_px  # how far down the row's rays go, 1 ahead
    drop = cam.ahead[2] + v * cam.down[2]  # of the rays, upwards, 1 ahead
    above = cam.eye[2] - studio.scene.base_z[0]
    far = -above / drop if drop < -1e-6 else FAR_M
    ground = 0.0 < far < FAR_M
    fill(depth, F(far if ground else FAR_M))
    fill(canvas.code, np.int32(-1))
    low, high = _hit_boxes(studio, canvas, y, boxes)
    if ground:
        shade_row(studio, canvas, v, far)
    copy(canvas.depth[y], depth)
    marked = max(0, low - 1)  # boxes cover columns of [low, high) at most
    marked -= marked % BLOCK
    mark_ends(canvas.code[marked:], canvas.ends[marked : whole(high)])
    x = 0
    while x < width:
        code = canvas.code[x]
        end = width
        if x < high:
            end = run_end(canvas.ends, canvas.end_words, max(x, low - 1), high)
            if end == high and code < 0:
                end = width
        if code < 0:
            _colour_open(studio, canvas, x, end, y, drop, far if ground else 0.0)
        else:
            _colour_box(studio, canvas, code, x, end, y)
        x = end
    if cam.beam > 0.0 and studio.look.night > 0:
        _shine(canvas, width)
    store_row(canvas.red, canvas.green, canvas.blue, canvas.rgb[y])


@kernel
def _colour_open(
    studio: Studio, canvas: Canvas, a: int, b: int, y: int, drop: float, far: float
) -> None:
    """Colours the pixels [a, b) of row y, on which no box is.

    Args:
        studio: All that the picture is made from.
        canvas: Painted on.
        a, b, y: The pixels.
        drop: How the row's rays rise, 1 ahead.
        far: Depth of the ground [m], 0 where the sky is.
    """
    if canvas.instance.shape[0] > 0:
        fill(canvas.instance[y, a:b], np.int32(0))
    tag = canvas.tag[y] if canvas.tag.shape[0] > 0 else canvas.untagged
    if far > 0.0:
        colour_ground(studio, canvas, a, b, y, far, drop, tag)
        return
    colour_sky(canvas, studio.look, a, b, drop)
    if canvas.tag.shape[0] > 0:
        fill(tag[a:b], np.uint8(_SKY))


@kernel
def _colour_box(studio: Studio, canvas: Canvas, code: int, a: int, b: int, y: int) -> None:
    """Colours the pixels [a, b) of row y, all of one face, `code` as in `colour_face`."""
    source = studio.seen.source[code // 6]
    if canvas.instance.shape[0] > 0:
        fill(canvas.instance[y, a:b], studio.boxes.instance[source])
    tag = canvas.tag[y] if canvas.tag.shape[0] > 0 else canvas.untagged
    if canvas.tag.shape[0] > 0:
        fill(tag[a:b], studio.boxes.tag[source])
    colour_face(studio, canvas, code, a, b, y, tag)


@kernel
def _shine(canvas: Canvas, width: int) -> None:
    """Brightens the row by the ego's own headlights."""
    cam, end = canvas.cam, whole(width)
    u0, du = F((0.5 - cam.cx_px) / cam.focal_px), F(1.0 / cam.focal_px)
    beam_span(canvas.shadow[:end], canvas.near[:end], F(6.0 * cam.beam), u0, du)
    multiply(canvas.red[:end], canvas.green[:end], canvas.blue[:end], canvas.shadow[:end])


@kernel
def _hit_boxes(studio: Studio, canvas: Canvas, y: int, boxes: Int32) -> tuple[int, int]:
    """Finds the nearest face at each pixel of a row; returns the columns that boxes may cover."""
    seen, row = studio.seen, F(y)
    low, high = canvas.depth.shape[1], 0
    for n in range(boxes.shape[0]):
        k = boxes[n]
        a, b = seen.rect[k, 0], seen.rect[k, 1]
        low, high = min(low, a), max(high, b)
        box = seen.source[k]
        rays = _rays_of_row(seen.rays[k], row, studio.boxes.half[box])
        end = a + whole(b - a)
        depth, code = canvas.near[a:end], canvas.code[a:end]
        if studio.boxes.pitch[box] == F(0.0):
            hit_upright(depth, code, F(a), F(b), np.int32(6 * k), rays)
        else:
            hit_box(depth, code, F(a), F(b), np.int32(6 * k), rays)
    return low, high


@kernel
def _rays_of_row(rays: Float32, row: F, half: Float32) -> BoxRays:
    """The rays of one row, from a box's `Projected.rays` (4, 3) and its half sides (3,)."""
    return BoxRays(
        rays[0, 0],
        rays[0, 1],
        rays[0, 2],
        rays[1, 0] + row * rays[3, 0],
        rays[1, 1] + row * rays[3, 1],
        rays[1, 2] + row * rays[3, 2],
        rays[2, 0],
        rays[2, 1],
        rays[2, 2],
        half[0],
        half[1],
        half[2],
    )
