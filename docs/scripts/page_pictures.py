"""Draws the documentation's pictures of pages and windows, of drives that it drives itself.

python -m docs.scripts.page_pictures                     all of them
python -m docs.scripts.page_pictures explain report      these

From the top of a checkout. `explain` and `report` need a Chromium on the path.
"""

from __future__ import annotations

import io
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from PIL import Image

from agents import load_agent
from di_envs.config import check_name
from di_envs.course import load_course
from di_envs.drawing.driver_view import DriverView
from di_envs.drawing.told_picture import told_picture
from di_envs.drawing.told_text import told_text
from di_envs.drawing.view import Renderer
from di_envs.route_env import RouteEnv
from leaderboard.commands.cli import main as driveinsight
from tests.leaderboard.pages.headless_browser import browser_page, find_browser

IMAGES = Path(__file__).resolve().parents[1] / "images"
QUALITY = 85  # of JPEG
# The shipped policy's one collision on town05_short with seed 0: just before it, and with whom
ROUTE, AT_S = "11", 22.5
WHAT_IF = "drop:obstacles; drop:bev; remove:actor=38"
REPORTED = ("4", "5", "6", "7")
BRANCHED = ("--route", "60", "--at", "3.0", "--world", "remove:actor=67")
PLAYED, PLAYED_S = "5", 8.1  # nearing a green light, to turn left


def command(*words: str) -> None:
    """Runs a command of ours.

    Raises:
        RuntimeError: If it fails.
    """
    code = driveinsight(words)
    if code:
        raise RuntimeError(f"driveinsight {' '.join(words)} ended with {code}")


def evaluate(folder: Path, agent: str, suite: str, routes: Sequence[str]) -> str:
    """Drives routes; returns where their run is."""
    where = str(folder / "run")
    drive = ("evaluate", "--agent", agent, "--suite", suite, "--output", where)
    command(*drive, "--route-ids", *routes)
    return where


def photograph(page: Path, fragment: str, size: tuple[int, int], name: str, last: str) -> None:
    """Saves a page as a browser shows it by day.

    Args:
        page: The file.
        fragment: The moment that its address names.
        size: The window's width and least height.
        name: Of the picture.
        last: Selects the element with which the picture ends; empty: it is as high as the window.

    Raises:
        RuntimeError: If there is no browser.
    """
    browser = find_browser()
    if browser is None:
        raise RuntimeError("pages are photographed by a Chromium, and none is on the path")
    with tempfile.TemporaryDirectory() as profile, browser_page(browser, Path(profile)) as tab:
        tab.resize(*size)
        tab.open(page, fragment)
        if last:
            end = f"document.querySelector('{last}').getBoundingClientRect().bottom + scrollY + 14"
            tab.resize(size[0], int(tab.script(end)))
        tab.script("new Promise((done) => setTimeout(done, 1500))")  # pictures are unpacked by then
        picture = Image.open(io.BytesIO(tab.photograph()))
        picture.convert("RGB").save(IMAGES / name, quality=QUALITY, optimize=True)


def explain(folder: Path) -> None:
    """Writes explain.jpg: a collision of the shipped policy, and what would have come instead."""
    run = evaluate(folder, "driveinsight", "town05_short", (ROUTE,))
    page = folder / "explain.html"
    asked = ("--route", ROUTE, "--at", str(AT_S), "--what-if", WHAT_IF)
    command("explain", run, *asked, "--output", str(page))
    photograph(page, f"#t={AT_S}", (1040, 900), "explain.jpg", "#what-if")


def report(folder: Path) -> None:
    """Writes report.jpg: a run of an expert that sees nobody, as its report opens."""
    run = evaluate(folder, "expert-blind", "town05_short", REPORTED)
    page = folder / "report.html"
    command("report", run, "--output", str(page))
    photograph(page, "", (1280, 920), "report.jpg", "")


def branch(folder: Path) -> None:
    """Writes branch.jpg: what `driveinsight branch` writes of docs/branching.md's own example."""
    run = evaluate(folder, "expert-blind", "town05_tiny", ("60",))
    command("branch", run, *BRANCHED, "--output", str(folder / "branch"))
    picture = Image.open(folder / "branch" / "branch.png").convert("RGB")
    picture.save(IMAGES / "branch.jpg", quality=QUALITY, optimize=True)


def moment() -> tuple[RouteEnv, dict[str, Any]]:
    """The expert's drive at the moment of `play` and `told`."""
    env = RouteEnv(suite="town05_short", observations=("prompt",))
    agent = load_agent("expert")
    observation, _ = env.reset(seed=0, options={"route": PLAYED})
    memory = agent.start(env.plan, 0)
    for _ in range(round(PLAYED_S / env.config.control_dt_s)):
        control, memory = agent.act({**observation, "world": env.view}, memory)
        observation, *_ = env.step(control)
    return env, observation


def play(folder: Path) -> None:
    """Writes play.png: what stands in the window of one who drives."""
    env, _ = moment()
    course = load_course(env.config.changes())
    frame = DriverView(course, Renderer(course)).frame(env.view)
    Image.fromarray(frame).save(IMAGES / "play.png", optimize=True)


def told(folder: Path) -> None:
    """Writes told.png, and says the text that docs/language_models.md has beside it."""
    _, observation = moment()
    Image.fromarray(told_picture(observation)).save(IMAGES / "told.png", optimize=True)
    print(told_text(observation))


PICTURES: dict[str, Callable[[Path], None]] = {
    one.__name__: one for one in (explain, report, branch, play, told)
}


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """What to draw."""

    names: Annotated[tuple[str, ...], tyro.conf.Positional] = tuple(PICTURES)
    """Which of them."""


def main(pictures: Pictures) -> None:
    """Drives and draws."""
    for name in pictures.names:
        check_name(name, PICTURES, "picture")
    for name in pictures.names:
        with tempfile.TemporaryDirectory() as folder:
            PICTURES[name](Path(folder))
        print(f"written: docs/images/{name}.*")


if __name__ == "__main__":
    try:
        main(tyro.cli(Pictures, description=__doc__))
    except ValueError as error:
        sys.exit(f"error: {error}")
