"""A recorded route explained: what its agent was told, responded to and looked at, by moment.

    from leaderboard.explaining.route import explain_route

    explanation = explain_route("results/mine", "3", at_s=12.5, what_if="drop:traffic_lights")
    explanation.gradient          # (N, G, 2) arrays, to compute with
    explanation                   # in a notebook: the page
    Path("why.html").write_text(explain_page(explanation))

The drive is retraced with its agent (`retracing.py`), which is looked into as it decides
(`agents.explain`). `docs/explain_page.md` says what there is to see.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from leaderboard.explaining.answers import Answering
from leaderboard.explaining.explanation import ExplainError, Explanation
from leaderboard.explaining.looks import DriveLooks
from leaderboard.explaining.questions import AskedEdit, questions_about, read_asked
from leaderboard.records.chosen_route import chosen_route
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.records.results import read_run
from leaderboard.replaying.futures import AHEAD_S
from leaderboard.replaying.recorded_agent import retrace_env, run_agent
from leaderboard.replaying.retracing import retrace
from leaderboard.replaying.timed_edits import decisions_before
from leaderboard.running.episode import close_agent

EVERY_S = 0.2  # between two moments that are looked into


def explain_route(
    run: RunRecord | Path | str,
    route: str | int,
    *,
    seed: int = 0,
    every_s: float = EVERY_S,
    at_s: float | None = None,
    what_if: str | Sequence[AskedEdit] = "",
    ahead_s: float = AHEAD_S,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> Explanation:
    """Explains a route of a run.

    Args:
        run: The run, or the folder that `driveinsight evaluate` wrote.
        route: The route's id.
        seed: Which of the run's seeds.
        every_s: How often the agent is looked into.
        at_s: Game time of the moment that `what_if` is about, and at which the page opens.
        what_if: Edits, each a question of its own: values, or their text joined by `;`.
        ahead_s: How far the futures of that moment are driven.
        on_progress: Told how many decisions were made, and how many there are to make.

    Raises:
        RouteChoiceError: If the run has no such route, or it was lost.
        ExplainError: If there is no such moment.
        EditError: If an edit cannot be read, or is of nothing that this agent has.
        ReplayError: If the route cannot be replayed here.
        RetraceError: If the agent does not drive it again here as it did.
        ResultsError: If the folder holds no run.
    """
    if not isinstance(run, RunRecord):
        run = read_run(Path(run))
    record = chosen_route(run, str(route), seed)
    for name, value_s in (("every_s", every_s), ("ahead_s", ahead_s)):
        if not value_s > 0.0:
            raise ExplainError(f"{name} must be more than 0 s, not {value_s:g}")
    edits = read_asked(what_if) if isinstance(what_if, str) else what_if
    env = retrace_env(run, front=True)
    at = _moment_number(record, at_s, bool(edits), env.config.control_dt_s)
    questions = questions_about(edits, at_s or 0.0, run, env)
    ahead = max(1, round(ahead_s / env.config.control_dt_s))
    steps = _Counted(record.steps + 1 + len(questions) * ahead, on_progress)
    agent = run_agent(run, env)
    try:
        looks = DriveLooks(run, record, env, agent, every_s, at if questions else None)
        answering = Answering(looks, questions, at, ahead, steps.one_more)
        for decision in retrace(run, record, agent=agent, env=env):
            looks.add(decision)
            answering.add(decision)
            steps.one_more()
        return looks.explanation(answering.what_if(), at_s or 0.0)
    finally:
        close_agent(agent)
        env.close()


def _moment_number(
    record: RouteRecord, at_s: float | None, asked: bool, control_dt_s: float
) -> int:
    """How many decisions come before the moment that is asked about."""
    if at_s is None:
        if asked:
            raise ExplainError("say at which moment what if is asked: --at SECONDS (at_s=)")
        return 0
    number = decisions_before(at_s, control_dt_s)
    if not 0 <= number < record.steps:
        last_s = max(record.steps - 1, 0) * control_dt_s
        raise ExplainError(
            f"route {record.route_id}, seed {record.seed} was driven to {record.game_s:g} s: ask "
            f"about a moment between 0 and {last_s:g} s, not {at_s:g} s"
        )
    return number


class _Counted:
    """Counts decisions, and tells of them."""

    def __init__(self, total: int, on_progress: Callable[[int, int], None]) -> None:
        self._total, self._tell, self._done = total, on_progress, 0

    def one_more(self) -> None:
        self._done = min(self._done + 1, self._total)
        self._tell(self._done, self._total)
