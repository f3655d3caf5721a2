"""The words of CARLA's `results.json`: keys, labels and messages of infractions, and sensors.

Source: CARLA leaderboard and scenario_runner, branches `leaderboard-1.0` and `leaderboard-2.x`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from di_envs.rules import Rules
from di_envs.world.kinds import EventKind
from leaderboard.records.record import (
    NOT_PLANNED,
    SIMULATION_CRASHED,
    EventRecord,
    RouteRecord,
    RunRecord,
    undriven_record,
)
from leaderboard.scoring.score import share_of_distance

# (event, key of its list, label of its rate); no rule set counts two events of one list
KEYS: Mapping[EventKind, tuple[str, str]] = MappingProxyType(
    {
        EventKind.COLLISION_WALKER: ("collisions_pedestrian", "Collisions with pedestrians"),
        EventKind.COLLISION_VEHICLE: ("collisions_vehicle", "Collisions with vehicles"),
        EventKind.COLLISION_STATIC: ("collisions_layout", "Collisions with layout"),
        EventKind.RED_LIGHT: ("red_light", "Red lights infractions"),
        EventKind.FIRST_HIT_WALKER: ("collisions_pedestrian", "Collisions with pedestrians"),
        EventKind.FIRST_HIT_VEHICLE: ("collisions_vehicle", "Collisions with vehicles"),
        EventKind.FIRST_HIT_STATIC: ("collisions_layout", "Collisions with layout"),
        EventKind.RED_LIGHT_WIDE: ("red_light", "Red lights infractions"),
        EventKind.STOP_SIGN: ("stop_infraction", "Stop sign infractions"),
        EventKind.OUTSIDE_LANES: ("outside_route_lanes", "Off-road infractions"),
        EventKind.ROUTE_DEVIATION: ("route_dev", "Route deviations"),
        EventKind.TIMEOUT: ("route_timeout", "Route timeouts"),
        EventKind.BLOCKED: ("vehicle_blocked", "Agent blocked"),
        EventKind.MIN_SPEED: ("min_speed_infractions", "Min speed infractions"),
    }
)
# what 2.x lists besides, which never happens here
YIELD = ("yield_emergency_vehicle_infractions", "Yield emergency vehicles infractions")
SCENARIO_TIMEOUT = ("scenario_timeouts", "Scenario timeouts")

SCORE_LABELS = ("Avg. driving score", "Avg. route completion", "Avg. infraction penalty")
_SENSORS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "camera": ("carla_camera",) * 4,
        "lidar": ("carla_lidar",),
        "radar": ("carla_radar",),
        "inertial": ("carla_gnss", "carla_imu", "carla_speedometer"),
    }
)


def sensors_of(run: RunRecord) -> list[str]:
    """The agent's sensors as CARLA's icons call them."""
    groups: Sequence[str] = run.requires.get("observations", ())
    return [sensor for group in groups for sensor in _SENSORS.get(group, ())]


def carla_status(record: RouteRecord) -> str:
    """The route's status in CARLA's words, which has one for all that the machinery lost."""
    return SIMULATION_CRASHED if record.lost else record.status


def refused_records(run: RunRecord) -> tuple[RouteRecord, ...]:
    """A record that says nothing for each route that could not be planned, and each seed."""
    pairs = [(route_id, seed) for route_id in run.refused for seed in run.seeds]
    return tuple(
        undriven_record(
            route_id=route_id,
            seed=seed,
            index=run.planned + number,
            status=NOT_PLANNED,
            reason=run.refused[route_id],
        )
        for number, (route_id, seed) in enumerate(pairs)
    )


def infraction_messages(record: RouteRecord, rules: Rules) -> dict[str, list[str]]:
    """Each kind of infraction that the rules list, with a message for each time it happened."""
    messages: dict[str, list[str]] = {KEYS[kind][0]: [] for kind in rules.infractions}
    for event in record.events:
        if event.kind in rules.infractions:
            messages[KEYS[event.kind][0]].append(_message(event, record))
    return messages


def _message(event: EventRecord, record: RouteRecord) -> str:
    place = f"(x={round(event.x, 3)}, y={round(event.y, 3)}, z={round(event.z, 3)})"
    match event.kind:
        case EventKind.RED_LIGHT | EventKind.RED_LIGHT_WIDE:
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
        case EventKind.MIN_SPEED:
            return f"Average speed is {round(event.value, 2)}% of the surrounding traffic's one"
    kind = event.other_type or "static"
    return f"Agent collided against object with type={kind} and id={event.other} at {place}"
