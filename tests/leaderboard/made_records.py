"""Records made by hand, for tests of what is done with results."""

from __future__ import annotations

from di_envs.world.kinds import EventKind
from leaderboard.records.record import Bound, EventRecord, RouteRecord, RunRecord
from leaderboard.scoring.score import Score


def event(kind: EventKind, **fields: object) -> EventRecord:
    values = {"tick": 40, "time_s": 2.0, "x": 1.23456, "y": -2.0, "z": 0.0, **fields}
    return EventRecord(kind=kind, **values)  # type: ignore[arg-type]


def route(route_id: str = "7", seed: int = 0, index: int = 0, **fields: object) -> RouteRecord:
    values = {
        "status": "Completed",
        "score": Score(route_completion=100.0, infraction_score=1.0),
        "length_m": 1000.0,
        "keypoints_m": 1000.0,
        "done_m": 1000.0,
        "travelled_m": 1000.0,
        "game_s": 200.0,
        "steps": 2000,
        "wall_s": 1.5,
        "bound": Bound(route_completion=100.0, finish_s=150.0, stopped_s=20.0),
        "route_hash": "aa",
        "observation_hash": "bb",
        "reward_hash": "cc",
        "event_hash": "dd",
        **fields,
    }
    return RouteRecord(route_id=route_id, seed=seed, index=index, world_seed=99, **values)  # type: ignore[arg-type]


def run_of(*routes: RouteRecord, planned: int | None = None, **fields: object) -> RunRecord:
    values = {
        "rules": "carla-1.0",
        "agent": "expert",
        "agent_version": "ee",
        "track": "PRIVILEGED",
        "requires": {
            "observations": ["prompt"],
            "control_dt_s": 0.1,
            "privileged": True,
            "options": {},
            "hd_map": False,
        },
        "suite": "town05_long",
        "suite_version": 1,
        "options": {"traffic": 3},
        "town": "town05",
        "town_hash": "ff",
        "routes_hash": "gg",
        "seeds": (0, 1),
        "versions": {"python": "3.11", "numpy": "2.4.6", "world": "1"},
        "cpu": "generic",
        **fields,
    }
    return RunRecord(planned=planned or len(routes), routes=routes, **values)  # type: ignore[arg-type]


def lost(status: str) -> RouteRecord:
    """A route that says nothing of the driving."""
    score = Score(route_completion=0.0, infraction_score=1.0)
    reason = "the worker was killed by SIGKILL"
    return route("8", index=1, status=status, reason=reason, score=score, done_m=0.0)


# Half done, through a red light and too late
RED = route(
    score=Score(route_completion=50.0, infraction_score=0.7),
    status="Failed - Agent timed out",
    done_m=500.0,
    events=(event(EventKind.RED_LIGHT, other=3), event(EventKind.TIMEOUT)),
)
