"""An explained route as one HTML file: the drive, what its agent was told, and what moved it.

The file holds everything it needs and asks for nothing else. `docs/explain_page.md` lists its data.
"""

from __future__ import annotations

import base64
import dataclasses
from collections.abc import Iterator, Mapping
from html import escape
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.prompt import COMPONENTS
from di_envs.sensors.camera.config import CameraConfig
from di_envs.town.plan import RoadOption
from di_envs.world.state import TICK_S
from leaderboard.explaining.explanation import Answer, Explanation, WhatIf
from leaderboard.pages.explain_tables import answers_table, telling_events
from leaderboard.pages.looks import QUIET_SHARE, look_columns, map_columns, map_shares
from leaderboard.pages.markup import Markup, element, joined, json_script, static_text
from leaderboard.pages.report_page import player_parts
from leaderboard.pages.report_tables import event_text, facts_table
from leaderboard.pages.route_films import event_heads, film_meta
from leaderboard.pages.told import told_columns
from leaderboard.pages.town_svg import town_svg
from leaderboard.records.blocks import Column, write_block
from leaderboard.records.footing import footing_differences, footing_here, footing_of
from leaderboard.records.record import RunRecord
from leaderboard.running.front_camera import FRONT

PAGE_FORMAT, PAGE_VERSION = "driveinsight-explanation", 1
SCRIPTS = (
    *("blocks.js", "film.js", "town.js", "scene.js", "scale.js", "player.js", "transport.js"),
    *("tables.js", "told.js", "looks.js", "front.js", "rows.js", "futures.js", "explain.js"),
)
FRAME_PX = 980  # height of the page in a notebook


class Page(str):
    """A page's text, which a notebook shows in a frame of its own."""

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{escape(self)}" style="width: 100%; height: {FRAME_PX}px; border: 0" '
            'sandbox="allow-scripts" title="DriveInsight explanation"></iframe>'
        )


def explain_page(explanation: Explanation) -> Page:
    """One self-contained page: see `docs/explain_page.md`."""
    run, record = explanation.run, explanation.record
    blocks = dict(_blocks(explanation))
    score = record.score
    facts = (
        f"seed {record.seed} · {record.status} · {record.game_s:.1f} s · "
        f"driving score {score.driving_score:.1f} = {score.route_completion:.1f} x "
        f"{score.infraction_score:.2f} · rules {run.rules} · {run.town}"
    )
    text = Template(static_text("explain.html")).substitute(
        title=joined([f"{run.title}, route {record.route_id}"]),
        subtitle=joined([facts]),
        style=static_text("style.css") + static_text("explain.css"),
        notes=joined(element("p", note, class_="note") for note in _notes(explanation)),
        **player_parts(),
        town=town_svg(explanation.town),
        answers=answers_table(explanation.what_if, run) if explanation.what_if else "",
        facts=facts_table(run),
        head=json_script("explanation", _head(explanation, blocks)),
        blocks=joined(
            element("script", Markup(text), type="text/plain", id=name)
            for name, text in blocks.items()
        ),
        scripts=joined(element("script", Markup("\n" + static_text(name))) for name in SCRIPTS),
    )
    return Page(text)


def _notes(explanation: Explanation) -> Iterator[str]:
    """What a reader must know before the pictures."""
    yield from explanation.missing
    run, done = explanation.run, explanation.record.interventions
    if done:
        yield f"With what was done to the world, or to what the agent saw: {'; '.join(done)}."
    differences = footing_differences(footing_here(run.agent), footing_of(run))
    if differences:
        yield (
            f"Retraced on {'; '.join(differences)} in the run; the agent saw and did the same all "
            "the same, to the bit."
        )


def _blocks(explanation: Explanation) -> Iterator[tuple[str, str]]:
    """The page's packed numbers by the id of the element that holds them."""
    record = explanation.record
    film = explanation.film
    yield "film", write_block(film_meta(film, record), film.columns())
    yield "looks", write_block({}, look_columns(explanation))
    if _is_told(explanation.seen):
        yield "told", write_block({}, told_columns(explanation.seen, explanation.poses))
    if explanation.images:
        sizes = {"bytes": Column(values=[len(image) for image in explanation.images])}
        yield "image-sizes", write_block({}, sizes)
        yield "images", base64.b64encode(b"".join(explanation.images)).decode("ascii")
    for name, maps in _shown_maps(explanation).items():
        yield f"map-{name}", write_block({}, map_columns(maps, map_shares(explanation, name)))
    if explanation.what_if is not None:
        yield from _future_blocks(explanation, explanation.what_if)


def _future_blocks(explanation: Explanation, what_if: WhatIf) -> Iterator[tuple[str, str]]:
    """Each future's film, and what the agent was told when it began."""
    pose = explanation.poses[what_if.moment][None]
    for number, answer in enumerate(_all_answers(what_if)):
        future = answer.future
        meta = film_meta(future.film, explanation.record)
        yield f"future-{number}", write_block(meta, future.film.columns())
        if _is_told(future.seen):
            told = {name: np.asarray(future.seen[name])[None] for name in _PROMPT}
            yield f"told-{number}", write_block({}, told_columns(told, pose))


_PROMPT = (*COMPONENTS, "prompt_present")


def _is_told(seen: Mapping[str, Any]) -> bool:
    """Whether there is a whole prompt in what is seen."""
    return all(name in seen for name in _PROMPT)


def _shown_maps(explanation: Explanation) -> dict[str, Any]:
    """The maps that have a place on the page: those of the ground, and the front camera's."""
    return {
        name: maps
        for name, maps in explanation.maps.items()
        if maps.extent_m is not None or maps.camera == FRONT
    }


def _all_answers(what_if: WhatIf | None) -> tuple[Answer, ...]:
    return (what_if.base, *what_if.answers) if what_if else ()


def _head(explanation: Explanation, blocks: Mapping[str, str]) -> dict[str, Any]:
    """What the page's script is to know beside the blocks."""
    layers, heads = explanation.attention.shape[1:3]
    return {
        "format": PAGE_FORMAT,
        "version": PAGE_VERSION,
        "route": explanation.record.route_id,
        "seed": explanation.record.seed,
        "open_at_s": explanation.open_at_s,
        "blocks": list(blocks),
        "tick_s": TICK_S,
        "groups": list(explanation.groups),
        "layers": layers,
        "heads": heads,
        "waypoints": explanation.waypoints.shape[1],
        "components": list(COMPONENTS),
        "commands": [_command(number) for number in range(max(RoadOption) + 1)],
        "events": event_heads(explanation.record, explanation.run),
        "camera": _camera_head(explanation.camera),
        "maps": [
            {
                "name": name,
                "block": f"map-{name}",
                "rows": maps.values.shape[1],
                "columns": maps.values.shape[2],
                "extent_m": maps.extent_m,
                "camera": maps.camera,
                "peak": float(maps.values.max(initial=0.0)),
                "share": float(map_shares(explanation, name).max(initial=0.0)),
                "quiet": QUIET_SHARE,
            }
            for name, maps in _shown_maps(explanation).items()
        ],
        "what_if": _what_if_head(explanation.what_if, explanation.run),
    }


def _camera_head(camera: CameraConfig | None) -> dict[str, Any] | None:
    """Where the front camera is, so that a path can be drawn into its picture."""
    return None if camera is None else dataclasses.asdict(camera)


def _command(number: int) -> str:
    return RoadOption(number).name.lower() if number else "none"


def _what_if_head(what_if: WhatIf | None, run: RunRecord) -> dict[str, Any] | None:
    if what_if is None:
        return None
    return {
        "at_s": what_if.at_s,
        "end_s": max(answer.future.end_s for answer in _all_answers(what_if)),
        "answers": [_answer_head(answer, run) for answer in _all_answers(what_if)],
    }


def _answer_head(answer: Answer, run: RunRecord) -> dict[str, Any]:
    future = answer.future
    points = () if answer.look is None else tuple(answer.look.response.waypoints)
    return {
        "edit": answer.edit,
        "control": None if answer.control is None else _rounded(answer.control),
        "waypoints": [_rounded(point) for point in points],
        "end_s": future.end_s,
        "status": future.status,
        "problem": future.problem,
        "events": [
            {"time_s": event.time_s, "text": event_text(event)}
            for event in telling_events(future, run)
        ],
    }


def _rounded(values: NDArray[np.float32]) -> list[float]:
    return [round(float(value), 4) for value in values]
