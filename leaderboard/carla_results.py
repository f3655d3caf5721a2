"""A run in the `results.json` schema of CARLA Leaderboard 1.0, readable by the tools people have.

Source: field names, statuses, labels and messages of the branch `leaderboard-1.0`. Its infractions
per kilometre are sums over routes of each route's own rate, not averages; our table pools instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from di_envs.world.state import EventKind
from leaderboard.record import SIMULATION_CRASHED, EventRecord, RouteRecord, RunRecord
from leaderboard.score import INFRACTIONS, infractions_per_km, mean_score, share_of_distance

# (event, key of its list, label of its rate), in the order of `values` and `labels`
_KEYS: Mapping[EventKind, tuple[str, str]] = MappingProxyType(
    {
        EventKind.COLLISION_WALKER: ("collisions_pedestrian", "Collisions with pedestrians"),
        EventKind.COLLISION_VEHICLE: ("collisions_vehicle", "Collisions with vehicles"),
        EventKind.COLLISION_STATIC: ("collisions_layout", "Collisions with layout"),
        EventKind.RED_LIGHT: ("red_light", "Red lights infractions"),
        EventKind.STOP_SIGN: ("stop_infraction", "Stop sign infractions"),
        EventKind.OUTSIDE_LANES: ("outside_route_lanes", "Off-road infractions"),
        EventKind.ROUTE_DEVIATION: ("route_dev", "Route deviations"),
        EventKind.TIMEOUT: ("route_timeout", "Route timeouts"),
        EventKind.BLOCKED: ("vehicle_blocked", "Agent blocked"),
    }
)
_SCORE_LABELS = ("Avg. driving score", "Avg. route completion", "Avg. infraction penalty")
_SENSORS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "camera": ("carla_camera",) * 4,
        "lidar": ("carla_lidar",),
        "inertial": ("carla_gnss", "carla_imu", "carla_speedometer"),
    }
)


def carla_results(run: RunRecord) -> dict[str, Any]:
    """The content of CARLA's `results.json` for this run, as JSON values."""
    records = [_route(record) for record in run.routes]
    whole = _global(run.scored, records) if run.scored else {}
    values, labels = _table(whole) if whole else ([], [])
    return {
        "_checkpoint": {
            "global_record": whole,
            "progress": [len(records), run.planned],
            "records": records,
        },
        "entry_status": _entry_status(run),
        "eligible": run.complete and not run.lost,
        "sensors": _sensors(run),
        "values": values,
        "labels": labels,
    }


def _entry_status(run: RunRecord) -> str:
    if not run.complete:
        return "Finished with missing data" if run.routes else "Started"
    if run.lost:
        return "Crashed"
    if any("Agent" in record.status for record in run.routes):
        return "Finished with agent errors"
    return "Finished"


def _sensors(run: RunRecord) -> list[str]:
    groups: Sequence[str] = run.requires.get("observations", ())
    return [sensor for group in groups for sensor in _SENSORS.get(group, ())]


def _route(record: RouteRecord) -> dict[str, Any]:
    infractions: dict[str, list[str]] = {key: [] for key, _ in _KEYS.values()}
    for event in record.events:
        if event.kind in _KEYS:
            infractions[_KEYS[event.kind][0]].append(_message(event, record))
    return {
        "route_id": f"RouteScenario_{record.route_id}",
        "index": record.index,
        "status": SIMULATION_CRASHED if record.lost else record.status,
        "infractions": infractions,
        "scores": {
            "score_route": record.score.route_completion,
            "score_penalty": record.score.infraction_score,
            "score_composed": record.score.driving_score,
        },
        "meta": {
            "duration_system": record.wall_s,
            "duration_game": record.game_s,
            "route_length": record.keypoints_m,
        },
    }


def _message(event: EventRecord, record: RouteRecord) -> str:
    place = f"(x={round(event.x, 3)}, y={round(event.y, 3)}, z={round(event.z, 3)})"
    match event.kind:
        case EventKind.RED_LIGHT:
            return f"Agent ran a red light {event.other} at {place}"
        case EventKind.STOP_SIGN:
            return f"Agent ran a stop with id={event.other} at {place}"
        case EventKind.OUTSIDE_LANES:
            share = 100.0 * share_of_distance(event.value, record.travelled_m)
            return (
                f"Agent went outside its route lanes for about {round(event.value, 3)} meters "
                f"({round(share, 2)}% of the completed route)"
            )
        case EventKind.ROUTE_DEVIATION:
            return f"Agent deviated from the route at {place}"
        case EventKind.BLOCKED:
            return f"Agent got blocked at {place}"
        case EventKind.TIMEOUT:
            return "Route timeout."
    kind = event.other_type or "static"
    return f"Agent collided against object with type={kind} and id={event.other} at {place}"


def _global(routes: Sequence[RouteRecord], records: Sequence[dict[str, Any]]) -> dict[str, Any]:
    driving, completion, penalty = mean_score([record.score for record in routes])
    exceptions = [
        [record["route_id"], record["index"], record["status"]]
        for record in records
        if record["status"] != "Completed"
    ]
    return {
        "route_id": -1,
        "index": -1,
        "status": "Failed" if exceptions else "Completed",
        "infractions": {
            key: math.fsum(_rate(record, kind) for record in routes)
            for kind, (key, _) in _KEYS.items()
        },
        "scores": {
            "score_route": completion,
            "score_penalty": penalty,
            "score_composed": driving,
        },
        "scores_std_dev": {
            "score_route": _deviation(routes, lambda r: r.score.route_completion),
            "score_penalty": _deviation(routes, lambda r: r.score.infraction_score),
            "score_composed": _deviation(routes, lambda r: r.score.driving_score),
        },
        "meta": {
            "total_length": math.fsum(record.keypoints_m for record in routes),
            "duration_game": math.fsum(record.game_s for record in routes),
            "duration_system": math.fsum(record.wall_s for record in routes),
            "exceptions": exceptions,
        },
    }


def _rate(record: RouteRecord, kind: EventKind) -> float:
    """Infractions of this kind per kilometre of keypoint polyline completed; 0 at RC 0."""
    count = sum(event.kind == kind for event in record.events)
    done_m = record.score.route_completion / 100.0 * record.keypoints_m
    return infractions_per_km(count, done_m)


def _deviation(routes: Sequence[RouteRecord], value: Callable[[RouteRecord], float]) -> float | str:
    """The sample standard deviation; CARLA writes the string NaN for a single route."""
    if len(routes) == 1:
        return "NaN"
    values = [value(record) for record in routes]
    mean = math.fsum(values) / len(values)
    return math.sqrt(math.fsum((x - mean) ** 2 for x in values) / (len(values) - 1))


def _table(whole: dict[str, Any]) -> tuple[list[str], list[str]]:
    """CARLA's twelve values, as strings with three decimals, and their labels."""
    scores, infractions = whole["scores"], whole["infractions"]
    numbers = [scores[key] for key in ("score_composed", "score_route", "score_penalty")]
    numbers += [infractions[_KEYS[kind][0]] for kind in INFRACTIONS]
    labels = [*_SCORE_LABELS, *(_KEYS[kind][1] for kind in INFRACTIONS)]
    return [f"{number:.3f}" for number in numbers], labels
