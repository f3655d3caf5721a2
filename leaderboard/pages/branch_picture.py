"""Both futures of a branch side by side: how they look from above at the same moments."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw, ImageFont

from di_envs.drawing.outlines import ACTOR, EDGE, EGO, LIGHT, ROUTE
from di_envs.drawing.view import MAP_PX, PIXELS_A_METRE
from di_envs.rules import rules_named
from di_envs.world.kinds import ActorKind
from di_envs.world.state import TICK_S
from leaderboard.pages.branch_moments import Body, Moment, edited_actors, moments_of, shown_times
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.branch import Branch, branch_run
from leaderboard.scoring.names import EVENT_NAMES

PANEL_PX = 360
_TEXT_PX, _TITLE_PX, _HEAD_PX, _GAP_PX, _LINE_PX = 14, 17, 34, 8, 17
_PAPER, _INK, _FAINT, _BAD = "#ffffff", "#1d2126", "#5b646c", "#c02a1f"
MARK = "#d6006c"  # of edited actors: nothing else has this colour
_SAID = {ActorKind.TRUCK: "lorry", ActorKind.VENDING_MACHINE: "vending machine"}
_NAMES = {
    "ego": EGO,
    **{_SAID.get(kind, kind.name.lower()): colour for kind, colour in ACTOR.items()},
    "route, target points": ROUTE,
    **{f"stop line: {state.name.lower()}": LIGHT[state] for state in LIGHT},
    "no light": "#ffffff",
}


def write_branch_picture(path: Path, run: RunRecord, branch: Branch) -> None:
    """Writes a PNG with a row of moments for each future, and what the colours are.

    Args:
        path: Where to.
        run: The run that was branched.
        branch: Its futures.

    Raises:
        OSError: If it cannot be written.
    """
    actors, times_s = edited_actors(branch), shown_times(run, branch)
    edited = branch_run(run, branch)
    texts = [str(edit.to_text()) for edit in branch.edits]
    rows = [
        ("as recorded", run, branch.recorded),
        (f"with {'; '.join(texts) or 'nothing changed'}", edited, branch.edited),
    ]
    high = PANEL_PX + _HEAD_PX + _GAP_PX
    width = len(times_s) * (PANEL_PX + _GAP_PX) + _GAP_PX
    marked = {f"actor {actor}, edited; crossed out: where it was": MARK for actor in actors[:1]}
    colours = {**_NAMES, **marked}
    places = _legend_places(colours, width)
    bottom = (places[-1][1] + 2) * _LINE_PX
    picture = Image.new("RGB", (width, len(rows) * high + bottom), _PAPER)
    moments = [list(moments_of(of_run, record, times_s, actors)) for _, of_run, record in rows]
    for number, (title, of_run, record) in enumerate(rows):
        line = f"{title}: driving score {record.score.driving_score:.1f}, {record.status}"
        _write(picture, (_GAP_PX, number * high + 8), line, _INK, _TITLE_PX)
        before = [None] * len(times_s) if number == 0 else moments[0]
        for column, (moment, was) in enumerate(zip_longest(moments[number], before)):
            place = (_GAP_PX + column * (PANEL_PX + _GAP_PX), number * high + _HEAD_PX)
            picture.paste(_panel(moment, was), place)
            _name(picture, place, moment, record, of_run)
    _legend(picture, len(rows) * high + 8, colours, places)
    picture.save(path)


def _panel(moment: Moment, was: Moment | None) -> Any:
    """The middle of the streets, with edited actors ringed; crossed out where they are no more."""
    edge = (MAP_PX - PANEL_PX) // 2
    panel = moment.streets.crop((edge, edge, MAP_PX - edge, MAP_PX - edge))
    pen = ImageDraw.Draw(panel)
    for actor, body in moment.bodies.items():
        _ring(pen, _corners(body, (0.0, 0.0)), str(actor))
    for actor, body in ({} if was is None else was.bodies).items():
        if actor not in moment.bodies:
            assert was is not None
            moved = (was.place[0] - moment.place[0], was.place[1] - moment.place[1])
            _cross_out(pen, _corners(body, moved), str(actor))
    return panel


def _corners(body: Body, moved_m: tuple[float, float]) -> list[tuple[float, float]]:
    """Four corners [pixels of a panel] around a body, a little outside, one after the other."""
    x, y = body.x_m + moved_m[0], body.y_m + moved_m[1]
    cos, sin = math.cos(body.yaw_rad), math.sin(body.yaw_rad)
    length, width = body.half_length_m + 0.4, body.half_width_m + 0.4
    around = ((-length, -width), (-length, width), (length, width), (length, -width))
    places = ((x + cos * a - sin * r, y + sin * a + cos * r) for a, r in around)
    middle = PANEL_PX / 2
    return [(middle + PIXELS_A_METRE * px, middle + PIXELS_A_METRE * py) for px, py in places]


def _ring(pen: Any, corners: list[tuple[float, float]], label: str) -> None:
    pen.line([*corners, corners[0]], _PAPER, 5, joint="curve")
    pen.line([*corners, corners[0]], MARK, 3, joint="curve")
    _label(pen, corners, label)


def _cross_out(pen: Any, corners: list[tuple[float, float]], label: str) -> None:
    first, second, third, fourth = corners
    for line in ([*corners, first], [first, third], [second, fourth]):
        pen.line(line, _PAPER, 4)
        pen.line(line, MARK, 2)
    _label(pen, corners, label)


def _label(pen: Any, corners: Sequence[tuple[float, float]], label: str) -> None:
    right, top = max(x for x, _ in corners) + 4, min(y for _, y in corners) - 4
    font = ImageFont.load_default(_TEXT_PX)
    pen.text((right, top), label, MARK, font, stroke_width=2, stroke_fill=_PAPER)


def _name(
    picture: Any, place: tuple[int, int], moment: Moment, record: RouteRecord, run: RunRecord
) -> None:
    """The moment's time, and the infractions that happen at it."""
    kinds = rules_named(run.rules).infractions
    now = [
        EVENT_NAMES[event.kind]
        for event in record.events
        if event.kind in kinds and abs(event.time_s - moment.time_s) < TICK_S / 2
    ]
    time = f"{moment.time_s:.2f}".removesuffix("0")
    label = " · ".join((f"{time} s", *now))
    left, top = place
    width = round(ImageFont.load_default(_TEXT_PX).getlength(label)) + 14
    ImageDraw.Draw(picture).rectangle((left, top, left + width, top + 22), _PAPER)
    _write(picture, (left + 6, top + 3), label, _BAD if now else _FAINT, _TEXT_PX)


def _legend_places(names: Iterable[str], width: int) -> list[tuple[int, int]]:
    """Where each entry begins [pixels], and in which line: as many in one as have room."""
    places, left, line = [], _GAP_PX, 0
    for name in names:
        long = 19 + round(ImageFont.load_default(_TEXT_PX - 1).getlength(name))
        if left > _GAP_PX and left + long > width - _GAP_PX:
            left, line = _GAP_PX, line + 1
        places.append((left, line))
        left += long + 12
    return places


def _legend(
    picture: Any, top: int, colours: Mapping[str, str], places: Iterable[tuple[int, int]]
) -> None:
    pen = ImageDraw.Draw(picture)
    for (name, colour), (left, line) in zip(colours.items(), places, strict=True):
        high = top + line * _LINE_PX
        pen.rectangle((left, high + 4, left + 14, high + 13), colour, EDGE)
        _write(picture, (left + 19, high), name, _FAINT, _TEXT_PX - 1)


def _write(picture: Any, place: tuple[int, int], text: str, colour: str, size: int) -> None:
    ImageDraw.Draw(picture).text(place, text, colour, ImageFont.load_default(size))
