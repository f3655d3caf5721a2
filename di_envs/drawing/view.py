"""A view for people: the streets around the ego from above, and the prompt in words.

Everything is a function of the world's state, so a picture can be made at any time, of any state,
and changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from di_envs.course import Course
from di_envs.drawing.map_tiles import MapTiles
from di_envs.drawing.outlines import (
    ACTOR,
    BRIDGE_M,
    EDGE,
    EGO,
    ROUTE,
    TARGET,
    Array,
    box,
    stop_line_colours,
    stop_line_ends,
)
from di_envs.drawing.prompt_text import prompt_in_words
from di_envs.observer import Observer
from di_envs.reward import standing_of
from di_envs.world.event_names import EVENT_NAMES, event_of_key
from di_envs.world.kinds import ActorKind, EventKind
from di_envs.world.struck import DOWN, footprint
from di_envs.world.world import WorldView

WIDTH_PX, HEIGHT_PX = 960, 640
MAP_PX = 640  # side of the map, on the left
PIXELS_A_METRE = 7
SMOOTHING = 2  # what moves is drawn so much larger, then averaged

PANEL = "#1d2126"  # beside the map
_TEXT, _FAINT, _TITLE = "#eceff1", "#98a2ab", "#ffffff"
_BAD, _BRAKE = "#ff6b5e", "#ff2a1f"
_TROUGH = "#333a41"
MARGIN, _LINE_PX, _LABEL_PX = 14, 19, 96
_TEXT_PX, _TITLE_PX = 13, 17
_CAMERA_PX = WIDTH_PX - MAP_PX
_INFRACTIONS = (
    EventKind.COLLISION_WALKER,
    EventKind.COLLISION_VEHICLE,
    EventKind.COLLISION_STATIC,
    EventKind.RED_LIGHT,
    EventKind.STOP_SIGN,
)


class Renderer:
    """Draws one ego's surroundings and what it is told."""

    def __init__(self, course: Course) -> None:
        self._course = course
        self._tiles = MapTiles(course.town, PIXELS_A_METRE * SMOOTHING)
        self._observer = Observer(course.town, ("prompt",))
        self._shown: tuple[WorldView, int] | None = None  # what the observer has taken up
        self._stop_lines = stop_line_ends(course.town.signals)
        self._glyphs = lru_cache(1024)(_glyphs)

    def frame(
        self, view: WorldView, ego: int = 0, observation: Mapping[str, Any] | None = None
    ) -> NDArray[np.uint8]:
        """A picture of the present state.

        Args:
            view: The world.
            ego: Whom the picture follows.
            observation: Of the ego; its `camera_front` is shown where there is one.

        Returns:
            (HEIGHT_PX, WIDTH_PX, 3) RGB.
        """
        picture = Image.new("RGB", (WIDTH_PX, HEIGHT_PX), PANEL)
        picture.paste(self.map(view, ego), (0, 0))
        top = MARGIN
        camera = (observation or {}).get("camera_front")
        if camera is not None:
            height = round(_CAMERA_PX * camera.shape[0] / camera.shape[1])
            shown = Image.fromarray(camera).resize((_CAMERA_PX, height))
            picture.paste(shown, (MAP_PX, 0))
            top += height
        self.write(picture, view, ego, top)
        return np.array(picture)

    # ---- the map

    def map(self, view: WorldView, ego: int = 0) -> Any:
        """The streets around the ego from above: an image of MAP_PX x MAP_PX.

        Shows all that moves, the route and the lights.
        """
        state = view.state
        middle = np.array([state.x[ego], state.y[ego]])
        corner = np.floor((middle * PIXELS_A_METRE - MAP_PX / 2) * SMOOTHING).astype(int)
        picture = Image.new("RGB", (MAP_PX * SMOOTHING, MAP_PX * SMOOTHING))
        pen = _Pen(picture, corner)
        for above in (False, True):
            if self._tiles.paste(picture, *corner.tolist(), above=above):
                pen.stop_lines(view, self._stop_lines, above)
                pen.route(view, ego, above)
                pen.actors(view, ego, above)
        return picture.reduce(SMOOTHING)

    # ---- the text

    def write(self, picture: Any, view: WorldView, ego: int, top: int) -> None:
        """Writes the facts of the drive into a picture's panel, right of the map, from `top` on."""
        left, state = MAP_PX + MARGIN, view.state
        standing = standing_of(state, ego)
        info = self._course.info(view, ego, standing, standing, ())
        suite = self._course.config.suite or view.town.name
        self._text(picture, (left, top), f"{suite}, route {info['route_id']}", _TITLE, _TITLE_PX)
        facts = [
            ("time", f"{info['game_time_s']:.1f} s of {view.plans[ego].timeout_s:.0f} s"),
            ("route done", f"{info['route_completion']:.1f} %"),
            ("driving score", f"{info['driving_score']:.1f}"),
            ("penalty", f"{info['infraction_penalty']:.2f}"),
        ]
        top = self._lines(picture, left, top + 26, "", facts)
        for name in ("throttle", "steer", "brake"):
            top = self._bar(picture, left, top, name, float(getattr(state, name)[ego]))
        prompt = prompt_in_words(self._observation(view, ego))
        top = self._lines(picture, left, top + 8, "Prompt", prompt)
        events = _events_in_words(state.counts[ego].tolist(), info["finished"])
        if events:
            self._lines(picture, left, top, "Events", events, _BAD)

    def _observation(self, view: WorldView, ego: int) -> Mapping[str, Any]:
        """The ego's prompt, whatever the environment itself shows to agents."""
        if self._shown is None or self._shown[0] is not view or self._shown[1] != ego:
            self._observer = self._observer.of_ego(ego)
            self._observer.start(view)
            self._shown = view, ego
        return self._observer.observe()

    def _lines(
        self,
        picture: Any,
        left: int,
        top: int,
        title: str,
        lines: list[tuple[str, str]],
        colour: str = _TEXT,
    ) -> int:
        """Writes a block of labelled lines; returns where the next one may begin."""
        if title:
            self._text(picture, (left, top), title, _TITLE, _TITLE_PX)
            top += 25
        for label, text in lines:
            self._text(picture, (left, top), label, _FAINT)
            self._text(picture, (left + _LABEL_PX, top), text, colour)
            top += _LINE_PX
        return top + 8

    def _bar(self, picture: Any, left: int, top: int, name: str, value: float) -> int:
        """A held control as a bar, from the left or, for steering, from the middle."""
        begin, end = left + _LABEL_PX, WIDTH_PX - MARGIN - 44
        zero = (begin + end) / 2 if name == "steer" else begin
        reach = zero + value * (end - zero)
        pen = ImageDraw.Draw(picture)
        pen.rectangle((begin, top + 4, end, top + 12), _TROUGH)
        colour = _BAD if name == "brake" else ROUTE
        pen.rectangle((min(zero, reach), top + 4, max(zero, reach), top + 12), colour)
        self._text(picture, (left, top), name, _FAINT)
        self._text(picture, (end + 6, top), f"{value:+.2f}", _TEXT)
        return top + _LINE_PX

    def _text(
        self, picture: Any, place: tuple[int, int], text: str, colour: str, size: int = _TEXT_PX
    ) -> None:
        picture.paste(colour, place, self._glyphs(text, size))


def _glyphs(text: str, size: int) -> Any:
    """A line of text as a mask, its top left corner at the line's."""
    font = ImageFont.load_default(size)
    mask = Image.new("L", (max(1, round(font.getlength(text))) + 2, 2 * size))
    ImageDraw.Draw(mask).text((0, 0), text, 255, font)
    return mask


def _events_in_words(counts: list[int], finished: str) -> list[tuple[str, str]]:
    """The infractions so far, and how the route has ended."""
    words = [(EVENT_NAMES[kind], f"{counts[kind]} x") for kind in _INFRACTIONS if counts[kind]]
    return [*words, ("route", EVENT_NAMES[event_of_key(finished)])] if finished else words


class _Pen:
    """Draws what moves, in metres, onto an enlarged window of the map."""

    def __init__(self, picture: Any, corner: NDArray[np.int64]) -> None:
        self._pen = ImageDraw.Draw(picture)
        self._corner = corner
        self._scale = PIXELS_A_METRE * SMOOTHING

    def _pixels(self, points: Array) -> Any:
        return points * self._scale - self._corner

    def _shown(self, pixels: Any, margin: float = 100.0) -> Any:
        side = MAP_PX * SMOOTHING
        return ((pixels > -margin) & (pixels < side + margin)).all(axis=-1)

    def stop_lines(self, view: WorldView, ends: Array, above: bool) -> None:
        pixels = self._pixels(ends)
        level = (view.town.signals.stop_pose[:, 2] > BRIDGE_M) == above
        colours = stop_line_colours(view)
        for line in np.flatnonzero(self._shown(pixels).any(axis=1) & level).tolist():
            self._pen.line(pixels[line].ravel().tolist(), colours[line], round(0.7 * self._scale))

    def route(self, view: WorldView, ego: int, above: bool) -> None:
        """The route ahead, its target points, and a flag of rings at its end."""
        plan, done = view.plans[ego], int(view.state.route_index[ego])
        pixels = self._pixels(plan.points[:, :2])
        drawn = self._shown(pixels) & ((plan.points[:, 2] > BRIDGE_M) == above)
        drawn[:done] = False
        for run in np.split(
            np.flatnonzero(drawn), np.flatnonzero(np.diff(np.flatnonzero(drawn)) > 1) + 1
        ):
            if len(run) > 1:
                width = round(0.7 * self._scale)
                self._pen.line(pixels[run].ravel().tolist(), ROUTE, width)
        for target in plan.targets[drawn[plan.targets]]:
            self._disc(pixels[target], 0.9, TARGET, ROUTE)
        if drawn[-1]:
            for radius, colour in ((2.0, ROUTE), (1.5, TARGET), (1.0, ROUTE)):
                self._disc(pixels[-1], radius, colour, colour)
        aim = int(plan.targets[view.state.target_index[ego]])
        if drawn[aim]:
            self._disc(pixels[aim], 1.4, ROUTE, TARGET)

    def actors(self, view: WorldView, ego: int, above: bool) -> None:
        state = view.state
        pixels = self._pixels(np.stack([state.x, state.y], axis=1))
        there = self._shown(pixels) & ((state.z > BRIDGE_M) == above)
        there &= (state.kind != ActorKind.ABSENT) & (state.kind != ActorKind.PROP)
        for actor in np.flatnonzero(there).tolist():
            if actor != ego:
                self._actor(state, actor, pixels[actor], ACTOR[ActorKind(int(state.kind[actor]))])
        if there[ego]:
            self._actor(state, ego, pixels[ego], EGO)

    def _actor(self, state: Any, actor: int, pixel: Array, colour: str) -> None:
        if state.kind[actor] == ActorKind.WALKER and state.walk_waiting[actor] != DOWN:
            self._disc(pixel, 0.45, colour, EDGE)
            return
        half_length, half_width = footprint(state, actor)
        outline = box(0.0, 0.0, state.yaw[actor], half_length, half_width) * self._scale + pixel
        self._pen.polygon(outline.ravel().tolist(), colour, EDGE, 2)
        if state.brake_light[actor]:
            self._pen.line(outline[:2].ravel().tolist(), _BRAKE, 6)

    def _disc(self, pixel: Array, radius_m: float, colour: str, edge: str) -> None:
        reach = radius_m * self._scale
        x, y = pixel
        self._pen.ellipse((x - reach, y - reach, x + reach, y + reach), colour, edge, 3)
