"""Responses of many recorded drives, kept on disk as they come: an interrupted look goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from agents.explain.protocol import explainable
from leaderboard.records.record import RouteRecord, RunRecord
from leaderboard.replaying.recorded_agent import retrace_env, run_agent
from leaderboard.responding.drive_responses import DriveResponses, drive_hash, drive_responses
from leaderboard.responding.response_files import (
    ResponseFileError,
    read_responses,
    responses_file,
    write_responses,
)
from leaderboard.running.episode import close_agent


def measured(
    run: RunRecord,
    records: Sequence[RouteRecord],
    folder: Path,
    *,
    every_s: float,
    on_time: Callable[[RouteRecord, float], None] = lambda record, time_s: None,
) -> Iterator[DriveResponses]:
    """Responses of each drive; those that the folder holds already are read.

    Args:
        run: The run.
        records: Drives of it.
        folder: Where responses are kept.
        every_s: Time between two looks.
        on_time: Told the drive and the game time that it has been looked through.

    Raises:
        NotExplainableError: If the agent's policy cannot be looked into.
        RetraceError: If the agent does not drive as recorded.
        ReplayError: If a route cannot be replayed here.
        OSError: If nothing can be written.
    """
    env = retrace_env(run, prompt=True)
    agent = run_agent(run, env)
    try:
        explainable(agent)  # before anything is driven
        for record in records:
            path = responses_file(folder, record.route_id, record.seed)
            found = _kept(path, record, every_s)
            if found is None:

                def told(time_s: float, record: RouteRecord = record) -> None:
                    on_time(record, time_s)

                found = drive_responses(
                    run, record, agent, every_s=every_s, env=env, on_decision=told
                )
                write_responses(path, found)
            on_time(record, record.game_s)
            yield found
    finally:
        close_agent(agent)
        env.close()


def _kept(path: Path, record: RouteRecord, every_s: float) -> DriveResponses | None:
    """What an earlier look found, if it was at this very drive, as closely."""
    if not path.is_file():
        return None
    try:
        found = read_responses(path)
    except ResponseFileError:
        return None
    same = found.drive == drive_hash(record) and abs(found.every_s - every_s) < 1e-6
    return found if same else None
