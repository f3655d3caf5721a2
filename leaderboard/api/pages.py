"""`report` and `explain`: a run, or one of its routes, as a page that opens in any browser."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from leaderboard.api.comparisons import as_run
from leaderboard.api.given_agents import GivenAgent, specification_of
from leaderboard.api.requests import requests
from leaderboard.api.runs import Routes, Run
from leaderboard.pages.markup import element
from leaderboard.records.record import RunRecord
from leaderboard.running.compiling import compile_progress
from leaderboard.running.displays.work_bar import work_bar
from leaderboard.running.terminal import Terminal

if TYPE_CHECKING:
    from leaderboard.explaining.explanation import Explanation


@dataclass(frozen=True, kw_only=True, repr=False)
class Page:
    """An HTML file that holds all that it needs; a notebook shows a link to it.

    Attributes:
        path: The file.
        explanation: What it is drawn from, as arrays; None for a report.
    """

    path: Path
    explanation: Explanation | None = None

    def __repr__(self) -> str:
        return f"<page {self.path}, {self.path.stat().st_size / 1e6:.1f} MB>"

    def _repr_html_(self) -> str:
        return element("a", repr(self)[1:-1], href=self.path.as_posix(), target="_blank")


def report(run: Run | Path | str, *, routes: Routes = (), output: Path | str | None = None) -> Page:
    """Writes a run as one page: tables, infractions on a map, replays of routes.

    Args:
        run: A run, or its folder.
        routes: Ids of those that it is about; all when empty.
        output: The page's file; None for `report.html` in the run's folder.

    Raises:
        RequestError: If there is no such run or route, or it cannot be replayed here.
    """
    from leaderboard.pages.report_page import chosen_routes, make_report, write_report

    ids = (routes,) if isinstance(routes, str | int) else tuple(routes)
    names = tuple(map(str, ids))
    with requests():
        run = as_run(run)
        path = Path(output or run.folder / "report.html")
        console = Terminal(stderr=True)
        bar = work_bar("replaying", "routes", console=console, transient=True)
        count = len(chosen_routes(run.record, names))
        with compile_progress(console), bar:
            task = bar.add_task("", total=count)
            page, _ = make_report(run.record, names, lambda film: bar.advance(task))
        write_report(path, page)
    return Page(path=path)


def explain(
    run: Run | Path | str,
    route: str | int,
    *,
    seed: int = 0,
    at_s: float | None = None,
    what_if: str = "",
    agent: GivenAgent | None = None,
    trust: bool = False,
    output: Path | str | None = None,
    **settings: Any,
) -> Page:
    """Writes a route as a page that shows why its agent drove so, and what if.

    Args:
        run: A run, or its folder.
        route: The route's id.
        seed: Which of the run's seeds.
        at_s: Game time at which the page opens, and of the moment that `what_if` is about.
        what_if: Edits joined by `;`, each a question of its own.
        agent: Who drove, where it is not found as the run names it.
        trust: The run's agent and edits may be loaded, even if they are code that is not ours.
        output: The page's file; None for one in the run's folder.
        settings: `every_s` and `ahead_s`, see `leaderboard.explaining.route.explain_route`.

    Raises:
        RequestError: If there is no such route or moment, or the agent does not drive it again.
    """
    from di_envs.files.plain_text import file_name
    from leaderboard.explaining.route import explain_route
    from leaderboard.pages.explain_page import explain_page
    from leaderboard.pages.report_page import write_report

    with requests():
        run = as_run(run, trust=trust)
        record = with_agent(run, agent)
        path = Path(output or run.folder / f"explain-{file_name(str(route))}.html")
        console = Terminal(stderr=True)
        bar = work_bar("explaining", "decisions", console=console, transient=True)
        with compile_progress(console), bar:
            task = bar.add_task("", total=None)
            explanation = explain_route(
                record,
                route,
                seed=seed,
                at_s=at_s,
                what_if=what_if,
                on_progress=lambda done, total: bar.update(task, completed=done, total=total),
                **settings,
            )
        write_report(path, explain_page(explanation))
    return Page(path=path, explanation=explanation)


def with_agent(run: Run, agent: GivenAgent | None) -> RunRecord:
    """A run whose agent and edits may be loaded, with the agent that is given in its place.

    Raises:
        UsageError: If that would run code of others which nobody trusts.
    """
    from leaderboard.commands.trusting import trusted_run

    if agent is not None and not isinstance(agent, str):
        spec = specification_of(agent, run.folder.parent)
        edited = trusted_run(run.record, agent="expert", trust=run.trusted)  # looks at its edits
        return dataclasses.replace(edited, agent=spec)
    return trusted_run(run.record, agent=agent, trust=run.trusted)
