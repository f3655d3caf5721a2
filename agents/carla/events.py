"""Collision, obstacle and lane-invasion sensors: a list of what happened in the tick, often empty.

Each event has the fields of CARLA's that are true here: `frame`, `timestamp` [s] and

- of a collision, one for each body that is touched, in every tick: `other_actor` (`id`, `type_id`),
  `normal_impulse` (a unit vector away from that body: no impulses are simulated);
- of an obstacle: `other_actor` and `distance` [m] from the car's middle;
- of a lane invasion, as the car comes to lie over a line: `crossed_lane_markings`, without entries.

`sensor.collision` of World on Rails' evaluator says whether there has been a collision so far.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from di_envs.sensors.carla_sensor import CarlaSensor, SensorSuiteError
from di_envs.sensors.carla_types import SensorType
from di_envs.world.kinds import TICK_S, ActorKind

REACH_M = 5.0  # of an obstacle sensor that says no `distance`: CARLA's
TYPE_IDS = {
    ActorKind.CAR: "vehicle.car",
    ActorKind.VAN: "vehicle.van",
    ActorKind.TRUCK: "vehicle.truck",
    ActorKind.BUS: "vehicle.bus",
    ActorKind.MOTORCYCLE: "vehicle.motorcycle",
    ActorKind.BICYCLE: "vehicle.bicycle",
    ActorKind.WALKER: "walker.pedestrian",
    ActorKind.PROP: "static.pole",
    ActorKind.DEBRIS: "static.prop.debris",
    ActorKind.VENDING_MACHINE: "static.prop.vendingmachine",
}


@dataclass(frozen=True, kw_only=True)
class EventMemory:
    """What sensors of events remember from tick to tick."""

    collided: bool = False
    across_line: bool = False

    def after(self, observation: Mapping[str, Any]) -> EventMemory:
        """The memory once a tick has been seen."""
        if "contacts" not in observation:
            return self
        return EventMemory(
            collided=self.collided or bool(observation["contacts"][0, 0] > 0),
            across_line=bool(observation["across_line"][0]),
        )


def events_of(
    sensor: CarlaSensor, observation: Mapping[str, Any], before: EventMemory, frame: int
) -> Any:
    """What a sensor of events says of a tick.

    Raises:
        SensorSuiteError: If the observation is of an environment with other sensors.
    """
    if "contacts" not in observation:
        raise SensorSuiteError(
            f"Sensor '{sensor.id}': the environment was made without group 'proximity'. An agent's "
            f"sensors() are asked for once, before the first route; they must be the same for "
            f"every route."
        )
    stamp = {"frame": frame, "timestamp": frame * TICK_S}
    match sensor.type:
        case SensorType.COLLIDED:
            return before.after(observation).collided
        case SensorType.COLLISION:
            rows = observation["contacts"].tolist()
            return [_collision(row, stamp) for row in rows if row[0] > 0.0]
        case SensorType.OBSTACLE:
            return _obstacles(sensor, observation["obstacle"].tolist(), stamp)
        case _:
            crosses = bool(observation["across_line"][0]) and not before.across_line
            return [SimpleNamespace(**stamp, crossed_lane_markings=[])] if crosses else []


def _collision(row: list[float], stamp: Mapping[str, Any]) -> SimpleNamespace:
    id_, kind, ahead_m, right_m = row
    far_m = max(math.hypot(ahead_m, right_m), 1e-6)
    away = SimpleNamespace(x=-ahead_m / far_m, y=-right_m / far_m, z=0.0)
    return SimpleNamespace(**stamp, other_actor=_actor(id_, kind), normal_impulse=away)


def _obstacles(
    sensor: CarlaSensor, row: list[float], stamp: Mapping[str, Any]
) -> list[SimpleNamespace]:
    id_, kind, far_m = row
    reach_m = float(sensor.given.get("distance", REACH_M))
    moving_only = str(sensor.given.get("only_dynamics", "")).lower() in ("true", "1")
    if id_ == 0.0 or far_m > reach_m or (moving_only and kind >= ActorKind.PROP):
        return []
    return [SimpleNamespace(**stamp, other_actor=_actor(id_, kind), distance=far_m)]


def _actor(id_: float, kind: float) -> SimpleNamespace:
    return SimpleNamespace(id=int(id_), type_id=TYPE_IDS[ActorKind(int(kind))])
