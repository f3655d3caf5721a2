"""The prompt as a picture from above with numbered objects, for language models that see.

Made of the prompt alone, in the ego frame with the ego's heading up: what was edited away is not in
it. Objects, lights (L) and signs (S) have the numbers that they have in `told_text`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from di_envs.drawing.outlines import ACTOR, EDGE, EGO, LIGHT, ROUTE, TARGET
from di_envs.drawing.told_text import rows_of
from di_envs.prompt import COMPONENTS
from di_envs.town.lanes import LightState
from di_envs.world.kinds import ActorKind

SIDE_PX = 640
PIXELS_A_METRE = 8
EGO_PX = (320, 440)  # more of what is ahead: 55 m, and 25 m of what is behind
_EGO_LENGTH_M, _EGO_WIDTH_M = 4.9, 2.12
_GROUND, _LINE, _CENTRE, _INK, _OTHER = "#4d535b", "#b6b9bd", "#7f8790", "#ffffff", "#c9b79c"
_LINE_M, _TEXT_PX = 1.6, 15  # half a stop line


def told_picture(observation: Mapping[str, Any]) -> NDArray[np.uint8]:
    """The prompt from above.

    Args:
        observation: With the group `prompt`, edited or not.

    Returns:
        (SIDE_PX, SIDE_PX, 3) RGB.
    """
    present = dict(zip(COMPONENTS, np.asarray(observation["prompt_present"]).tolist(), strict=True))
    picture = Image.new("RGB", (SIDE_PX, SIDE_PX), _GROUND)
    pen = _Pen(picture)
    for name, draw in (
        ("map", pen.map),
        ("routing", pen.route),
        ("target_point", pen.target),
        ("traffic_lights", pen.lights),
        ("stop_signs", pen.signs),
        ("obstacles", pen.obstacles),
    ):
        if present[name]:
            draw(observation[name])
    pen.box(0.0, 0.0, 0.0, _EGO_LENGTH_M, _EGO_WIDTH_M, EGO)
    return np.array(picture)


class _Pen:
    """Draws in metres of the ego frame."""

    def __init__(self, picture: Any) -> None:
        self._pen = ImageDraw.Draw(picture)
        self._font = ImageFont.load_default(_TEXT_PX)

    def box(self, x: float, y: float, yaw: float, length: float, width: float, colour: str) -> None:
        cos, sin = math.cos(yaw), math.sin(yaw)
        around = [(-0.5, -0.5), (-0.5, 0.5), (0.3, 0.5), (0.5, 0.0), (0.3, -0.5)]  # with a nose
        outline = [(length * a, width * b) for a, b in around]
        corners = [_pixel(x + cos * a - sin * r, y + sin * a + cos * r) for a, r in outline]
        self._pen.polygon(corners, colour, EDGE, 2)

    def map(self, lines: Any) -> None:
        for line in np.asarray(lines):
            points = line[line[:, 3] > 0.0]
            if len(points) > 1:
                colour = _CENTRE if points[0, 2] == 1 else _LINE
                self._pen.line([_pixel(x, y) for x, y in points[:, :2].tolist()], colour, 2)

    def route(self, routing: Any) -> None:
        points = [_pixel(x, y) for x, y in rows_of(routing)[:, :2].tolist()]
        if len(points) > 1:
            self._pen.line(points, ROUTE, 5)

    def target(self, target: Any) -> None:
        x, y = _pixel(float(target[0]), float(target[1]))
        self._pen.ellipse((x - 8, y - 8, x + 8, y + 8), TARGET, ROUTE, 3)

    def lights(self, lights: Any) -> None:
        for number, (x, y, yaw, state, _) in enumerate(rows_of(lights).tolist(), start=1):
            colour = LIGHT[LightState(int(state))] if state else _INK
            self._stop_line(x, y, yaw, colour, f"L{number}")

    def signs(self, signs: Any) -> None:
        for number, (x, y, yaw, _) in enumerate(rows_of(signs).tolist(), start=1):
            self._stop_line(x, y, yaw, _INK, f"S{number}")

    def obstacles(self, obstacles: Any) -> None:
        rows = rows_of(obstacles).tolist()
        for x, y, yaw, length, width, _, _, kind, _ in rows:
            colour = ACTOR.get(ActorKind(int(kind)), _OTHER)
            self.box(x, y, yaw, max(length, 1.0), max(width, 1.0), colour)
        for number, (x, y, *_) in enumerate(rows, start=1):
            self._number(x, y, str(number))

    def _stop_line(self, x: float, y: float, yaw: float, colour: str, label: str) -> None:
        across = (-math.sin(yaw) * _LINE_M, math.cos(yaw) * _LINE_M)
        ends = [_pixel(x + sign * across[0], y + sign * across[1]) for sign in (-1.0, 1.0)]
        self._pen.line(ends, colour, 6)
        self._number(x, y, label)

    def _number(self, x: float, y: float, label: str) -> None:
        column, row = _pixel(x, y)
        self._pen.text(
            (column + 7, row - 18), label, _INK, self._font, stroke_width=2, stroke_fill=EDGE
        )


def _pixel(ahead_m: float, right_m: float) -> tuple[float, float]:
    return EGO_PX[0] + PIXELS_A_METRE * right_m, EGO_PX[1] - PIXELS_A_METRE * ahead_m
