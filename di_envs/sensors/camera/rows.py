"""One camera's images, row by row: what each pixel shows, then its colour in runs of one face.

Boxes are tested only on the spans of the rows that they may cover.
"""

from __future__ import annotations

import numpy as np

from di_envs.numerics.kernels import kernel
from di_envs.sensors.camera.drops import add_glow, add_rain
from di_envs.sensors.camera.face_shading import colour_face, colour_sky
from di_envs.sensors.camera.ground_shading import colour_ground, shade_row
from di_envs.sensors.camera.projection import place_camera, project_boxes, project_shadows
from di_envs.sensors.camera.spans import (
    beam_span,
    fill,
    hit_box,
    hit_upright,
    multiply,
    run_end,
    store_row,
)
from di_envs.sensors.scene.tags import Tag

FAR_M = 1000.0  # depth of the sky
_SKY = int(Tag.SKY)
F = np.float32


@kernel
def render(studio, canvas, ego, key):
    """Takes the images of one camera.

    Args:
        studio: `Studio`; its boxes were collected before.
        canvas: `Canvas` of the camera, written.
        ego: The ego's index.
        key: The camera's own, for its own rain.
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
        add_rain(studio.state, key, look.numbers[4], canvas.rgb)


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
        shade_row(studio, canvas, v, far)
    with_tag, with_who = canvas.tag.shape[0] > 0, canvas.instance.shape[0] > 0
    tag = canvas.tag[y] if with_tag else canvas.last
    who = canvas.instance[y] if with_who else canvas.code
    x, width = 0, depth.shape[0]
    while x < width:
        code = canvas.code[x]
        end = width
        if x < high:  # boxes cover columns of [low, high) at most
            end = run_end(canvas.code, max(x, low - 1), high)
            if end == high and code < 0:
                end = width
        if code < 0:
            if with_who:
                fill(who[x:end], np.int32(0))
            if ground:
                colour_ground(studio, canvas, x, end, y, far, drop, tag)
            else:
                colour_sky(canvas, look, x, end, drop)
                if with_tag:
                    fill(tag[x:end], np.uint8(_SKY))
        else:
            source = seen.source[code // 6]
            if with_who:
                fill(who[x:end], studio.boxes.instance[source])
            if with_tag:
                fill(tag[x:end], studio.boxes.tag[source])
            colour_face(studio, canvas, code, x, end, y, tag)
        x = end
    if cam[15] > 0.0 and look.numbers[5] > 0.0:
        u0, du = F((0.5 - cam[13]) / cam[12]), F(1.0 / cam[12])
        beam_span(canvas.shadow, depth, F(6.0 * cam[15]), u0, du)
        multiply(canvas.red, canvas.shadow)
        multiply(canvas.green, canvas.shadow)
        multiply(canvas.blue, canvas.shadow)
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
        at_row_x, at_row_y = ray[3] + row * ray[9], ray[4] + row * ray[10]
        if studio.boxes.pitch[seen.source[k]] == F(0.0):
            hit_upright(
                depth[a:b], canvas.code[a:b], F(a), np.int32(6 * k), ray[0], ray[1], ray[2],
                at_row_x, at_row_y, ray[5] + row * ray[11], ray[6], ray[7],
                half[0], half[1], half[2],
            )  # fmt: skip
        else:
            hit_box(
                depth[a:b], canvas.code[a:b], F(a), np.int32(6 * k), ray[0], ray[1], ray[2],
                at_row_x, at_row_y, ray[5] + row * ray[11], ray[6], ray[7], ray[8],
                half[0], half[1], half[2],
            )  # fmt: skip
    return low, high
