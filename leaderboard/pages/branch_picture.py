"""Both futures of a branch side by side: how they look from above at the same moments."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from di_envs.course import load_course
from di_envs.drawing.view import MAP_PX, Renderer
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.branch import Branch, branch_run
from leaderboard.replaying.replay import replay, replay_env
from leaderboard.replaying.timed_edits import decisions_before

AFTER_S = (0.0, 2.0, 4.0, 8.0)  # moments after the branch that are shown
PANEL_PX = 360
_TEXT_PX, _TITLE_PX, _HEAD_PX, _GAP_PX = 14, 17, 34, 8
_PAPER, _INK, _FAINT = "#ffffff", "#1d2126", "#6d767e"


def write_branch_picture(path: Path, run: RunRecord, branch: Branch) -> None:
    """Writes a PNG with a row of moments for each future.

    Args:
        path: Where to.
        run: The run that was branched.
        branch: Its futures.

    Raises:
        OSError: If it cannot be written.
    """
    edited = branch_run(run, branch)
    texts = [str(edit.to_text()) for edit in branch.edits]
    rows = [
        ("as recorded", run, branch.recorded),
        (f"with {'; '.join(texts) or 'nothing changed'}", edited, branch.edited),
    ]
    width = len(AFTER_S) * (PANEL_PX + _GAP_PX) + _GAP_PX
    picture = Image.new("RGB", (width, len(rows) * (PANEL_PX + _HEAD_PX + _GAP_PX)), _PAPER)
    for number, (title, of_run, record) in enumerate(rows):
        top = number * (PANEL_PX + _HEAD_PX + _GAP_PX)
        score = record.score
        line = f"{title}: driving score {score.driving_score:.1f}, {record.status}"
        _write(picture, (_GAP_PX, top + 8), line, _INK, _TITLE_PX)
        for column, (time_s, view) in enumerate(_moments(of_run, record, branch.at_s)):
            left = _GAP_PX + column * (PANEL_PX + _GAP_PX)
            picture.paste(Image.fromarray(view), (left, top + _HEAD_PX))
            label = f"{time_s:.1f} s"
            box = (left, top + _HEAD_PX, left + 64, top + _HEAD_PX + 22)
            ImageDraw.Draw(picture).rectangle(box, _PAPER)
            _write(picture, (left + 6, top + _HEAD_PX + 3), label, _FAINT, _TEXT_PX)
    picture.save(path)


def _moments(
    run: RunRecord, record: RouteRecord, at_s: float
) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    """The streets around the ego at each moment, or at the end where the route is over before."""
    env = replay_env(run)
    renderer = Renderer(load_course(env.config.changes()))
    wanted = _decisions(at_s, env.config.control_dt_s, record.steps)
    for step in replay(run, record, env=env):
        if step.decision in wanted:
            middle = (MAP_PX - PANEL_PX) // 2
            shown = renderer.map(step.view).crop((middle, middle, *(2 * (MAP_PX - middle,))))
            yield step.time_s, np.asarray(shown)


def _decisions(at_s: float, control_dt_s: float, last: int) -> Sequence[int]:
    return [min(decisions_before(at_s + after, control_dt_s), last) for after in AFTER_S]


def _write(picture: Any, place: tuple[int, int], text: str, colour: str, size: int) -> None:
    ImageDraw.Draw(picture).text(place, text, colour, ImageFont.load_default(size))
