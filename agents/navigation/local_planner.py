"""`RoadOption` and `LocalPlanner`, where agents for the CARLA Leaderboard import them from.

The planner follows waypoints with two controllers, of steering on the bearing of a point ahead and
of pedals on speed. Source: interface of CARLA's `agents.navigation.local_planner` (MIT licence);
our own code, tuned to this world's car.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from agents.carla.values import carla_values
from di_envs.town.plan import RoadOption

Plan = Sequence[tuple[Any, Any]]  # waypoints, each with its road option
KPH = 3.6
STEP_M = 2.0  # between waypoints that it finds itself
LOOK_M, LOOK_S = 3.0, 0.35  # the point ahead that it steers for: metres, and seconds of its speed
REAR_M = 1.4  # from the car's middle to its rear axle
WINDOW = 30  # waypoints among which it looks for the one that it has come to
FREE_M = 60.0  # that it looks ahead where it was given no plan
DT_S = 0.05
_STEER, _STEER_RATE = 1.35, 0.1
_CRUISE, _PEDAL, _BRAKE = 0.32, 0.25, 0.35  # throttle that holds a speed; and by its error [s/m]


class LocalPlanner:
    """Follows waypoints.

    Args:
        vehicle: An actor with `get_transform`, `get_velocity` and `get_speed_limit`.
        opt_dict: `target_speed` [km/h], `follow_speed_limits`, `dt` [s]; others are ignored.
        map_inst: The map; None to ask the vehicle's world.
    """

    def __init__(
        self, vehicle: Any, opt_dict: dict[str, Any] | None = None, map_inst: Any = None
    ) -> None:
        options = opt_dict or {}
        self._vehicle, self._given_map = vehicle, map_inst
        self._target_speed = float(options.get("target_speed", 20.0))
        self._follow_limits = bool(options.get("follow_speed_limits", False))
        self._dt_s = float(options.get("dt", DT_S))
        self._plan: list[tuple[Any, Any]] = []
        self._given = False  # a plan, at whose end it stops
        self._at = 0  # index of the waypoint that it has come to
        self._bearing: float | None = None
        self.target_waypoint: Any = None
        self.target_road_option: Any = RoadOption.VOID

    def set_speed(self, speed: float) -> None:
        """The speed to drive at [km/h]."""
        self._target_speed, self._follow_limits = float(speed), False

    def follow_speed_limits(self, value: bool = True) -> None:
        """Drive at what is allowed instead."""
        self._follow_limits = value

    def set_global_plan(
        self, current_plan: Plan, stop_waypoint_creation: bool = True, clean_queue: bool = True
    ) -> None:
        """Follows these waypoints, or also these, and stops at the last."""
        if clean_queue:
            self._plan, self._at = [], 0
        self._plan += list(current_plan)
        self._given = True

    def get_plan(self) -> list[tuple[Any, Any]]:
        """What is left of the plan."""
        return self._plan[self._at :]

    def get_incoming_waypoint_and_direction(self, steps: int = 3) -> tuple[Any, Any]:
        """The waypoint so many ahead; the last one where there are fewer."""
        left = self.get_plan()
        return left[min(steps, len(left) - 1)] if left else (None, RoadOption.VOID)

    def done(self) -> bool:
        """Whether nothing is left."""
        return self._given and self._at >= len(self._plan) - 1

    def run_step(self, debug: bool = False) -> Any:
        """The control of this tick."""
        self._find_more()
        self._advance()
        if not self._plan or self.done():
            return self._control(0.0, 0.0)
        speed = _speed_mps(self._vehicle)
        self.target_waypoint, self.target_road_option = self._aim(LOOK_M + LOOK_S * speed)
        bearing = _bearing(self._vehicle.get_transform(), self.target_waypoint.transform.location)
        before = bearing if self._bearing is None else self._bearing
        self._bearing = bearing
        steer = _STEER * bearing + _STEER_RATE * (bearing - before) / self._dt_s
        return self._control(self._speed_kph() / KPH, steer)

    def _speed_kph(self) -> float:
        limit = float(self._vehicle.get_speed_limit()) if self._follow_limits else 0.0
        return limit if limit > 0.0 else self._target_speed

    def _control(self, wanted_mps: float, steer: float) -> Any:
        control = carla_values().VehicleControl()
        error = wanted_mps - _speed_mps(self._vehicle)
        control.steer = min(max(steer, -1.0), 1.0)
        if wanted_mps < 0.1:
            control.brake = 0.8
        elif error < -0.4:
            control.brake = min(max(-_BRAKE * error, 0.0), 1.0)
        else:
            control.throttle = min(max(_CRUISE + _PEDAL * error, 0.0), 0.75)
        return control

    def _find_more(self) -> None:
        """Without a plan: straight on, where lanes part."""
        if self._given:
            return
        if not self._plan:
            town_map = self._given_map or self._vehicle.get_world().get_map()
            here = town_map.get_waypoint(self._vehicle.get_transform().location)
            self._plan = [] if here is None else [(here, RoadOption.LANEFOLLOW)]
        while self._plan and (len(self._plan) - self._at) * STEP_M < FREE_M:
            last = self._plan[-1][0]
            ways = last.next(STEP_M)
            if not ways:
                return
            yaw = last.transform.rotation.yaw
            straight = min(ways, key=lambda way: abs(_turn_deg(way.transform.rotation.yaw, yaw)))
            self._plan.append((straight, RoadOption.LANEFOLLOW))

    def _advance(self) -> None:
        """Notes the waypoint that it has come to: the nearest of the next ones."""
        place = self._vehicle.get_transform().location
        window = self._plan[self._at : self._at + WINDOW]
        far_m = [place.distance(waypoint.transform.location) for waypoint, _ in window]
        if far_m:
            self._at += far_m.index(min(far_m))

    def _aim(self, look_m: float) -> tuple[Any, Any]:
        """The first waypoint that is at least so far from the car."""
        place = self._vehicle.get_transform().location
        for waypoint, option in self._plan[self._at + 1 :]:
            if place.distance(waypoint.transform.location) >= look_m:
                return waypoint, option
        return self._plan[-1]


def _speed_mps(vehicle: Any) -> float:
    velocity = vehicle.get_velocity()
    return math.hypot(velocity.x, velocity.y)


def _bearing(transform: Any, target: Any) -> float:
    """The direction of a place from the rear axle, positive to the right [rad]."""
    yaw = math.radians(transform.rotation.yaw)
    dx, dy = target.x - transform.location.x, target.y - transform.location.y
    ahead = math.cos(yaw) * dx + math.sin(yaw) * dy
    right = math.cos(yaw) * dy - math.sin(yaw) * dx
    return math.atan2(right, ahead + REAR_M)


def _turn_deg(yaw: float, before: float) -> float:
    return math.remainder(yaw - before, 360.0)


__all__ = ["LocalPlanner", "RoadOption"]
