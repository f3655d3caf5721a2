"""`BasicAgent` for agents for CARLA: follows a route, stops for whoever is on it and at red lights.

It asks the vehicle's world who is there, so it drives for privileged agents only.
Source: interface of CARLA's `agents.navigation.basic_agent` (MIT licence), of 0.9.10 and later; our
own code.
"""

from __future__ import annotations

import math
from typing import Any

from agents.carla.values import carla_values
from agents.navigation.global_route_planner import GlobalRoutePlanner, Trace
from agents.navigation.local_planner import LocalPlanner, Plan

BRAKING_MPS2 = 4.0
GAP_M = 5.0  # from the car's middle to what it stops before, besides its braking distance
STOP_M = 4.0  # … and to a stop line
ASIDE_M = 1.3  # from the middle of its way within which a body's edge is in it
LINE_M = 2.0  # from its way within which a stop line is one on it
GONE_M = 2.5  # a line nearer than this was passed


class BasicAgent:
    """Drives a vehicle along a route.

    Args:
        vehicle: The actor.
        target_speed: Kilometres an hour.
        opt_dict: `ignore_traffic_lights`, `ignore_vehicles`, `sampling_resolution` [m], and what a
            `LocalPlanner` takes; others are ignored.
        map_inst: The map; None to ask the vehicle's world.
        grp_inst: A `GlobalRoutePlanner`; None for one of its own.
    """

    def __init__(
        self,
        vehicle: Any,
        target_speed: float = 20.0,
        opt_dict: dict[str, Any] | None = None,
        map_inst: Any = None,
        grp_inst: Any = None,
    ) -> None:
        options = {"target_speed": target_speed, **(opt_dict or {})}
        self._vehicle, self._world = vehicle, vehicle.get_world()
        self._map = map_inst or self._world.get_map()
        self._ignore_lights = bool(options.get("ignore_traffic_lights", False))
        self._ignore_vehicles = bool(options.get("ignore_vehicles", False))
        self._local_planner = LocalPlanner(vehicle, options, self._map)
        resolution_m = float(options.get("sampling_resolution", 2.0))
        self._global_planner = grp_inst or GlobalRoutePlanner(self._map, resolution_m)
        self._lines: list[tuple[Any, Any]] | None = None  # lights, each with a place to stop

    def set_target_speed(self, speed: float) -> None:
        """Kilometres an hour."""
        self._local_planner.set_speed(speed)

    def follow_speed_limits(self, value: bool = True) -> None:
        """Drive at what is allowed instead."""
        self._local_planner.follow_speed_limits(value)

    def get_local_planner(self) -> LocalPlanner:
        """What follows the waypoints."""
        return self._local_planner

    def get_global_planner(self) -> Any:
        """What finds the way."""
        return self._global_planner

    def set_destination(
        self, end_location: Any, start_location: Any = None, clean_queue: bool = True
    ) -> None:
        """Drives to a place.

        Args:
            end_location: A `carla.Location`, or x, y, z as 0.9.10 has it.
            start_location: From where; None for where the vehicle is.
            clean_queue: Forget what was to be followed.
        """
        if isinstance(end_location, list | tuple):
            end_location = carla_values().Location(*map(float, end_location))
        start = start_location or self._vehicle.get_location()
        way = self._global_planner.trace_route(start, end_location)
        self._local_planner.set_global_plan(way, clean_queue=clean_queue)

    def set_global_plan(
        self, plan: Plan, stop_waypoint_creation: bool = True, clean_queue: bool = True
    ) -> None:
        """Follows these waypoints."""
        self._local_planner.set_global_plan(plan, stop_waypoint_creation, clean_queue)

    def trace_route(self, start_waypoint: Any, end_waypoint: Any) -> Trace:
        """The way between two waypoints."""
        start, end = start_waypoint.transform.location, end_waypoint.transform.location
        found: Trace = self._global_planner.trace_route(start, end)
        return found

    _trace_route = trace_route  # its name in 0.9.10

    def ignore_traffic_lights(self, active: bool = True) -> None:
        """Drive on at red."""
        self._ignore_lights = active

    def ignore_vehicles(self, active: bool = True) -> None:
        """Drive on whoever is there."""
        self._ignore_vehicles = active

    def ignore_stop_signs(self, active: bool = True) -> None:
        """It does so in any case, as CARLA's."""

    def done(self) -> bool:
        """Whether it is there."""
        return self._local_planner.done()

    def run_step(self, debug: bool = False) -> Any:
        """The control of this tick."""
        control = self._local_planner.run_step(debug)
        return self.add_emergency_stop(control) if self._must_stop() else control

    def add_emergency_stop(self, control: Any) -> Any:
        """The same steering, and the brake."""
        control.throttle, control.brake, control.hand_brake = 0.0, 1.0, False
        return control

    def _must_stop(self) -> bool:
        velocity = self._vehicle.get_velocity()
        speed = math.hypot(velocity.x, velocity.y)
        braking_m = speed * 0.2 + speed * speed / (2.0 * BRAKING_MPS2)
        way = self._way(braking_m + GAP_M + 2.0)
        if not self._ignore_vehicles and self._met(way, braking_m + GAP_M):
            return True
        return not self._ignore_lights and self._red(way, braking_m + STOP_M)

    def _way(self, length_m: float) -> list[tuple[float, float, float]]:
        """Points of the way ahead: x, y, and metres along it from the vehicle."""
        place = self._vehicle.get_location()
        points, far_m = [(place.x, place.y, 0.0)], 0.0
        for waypoint, _ in self._local_planner.get_plan()[1:]:
            there = waypoint.transform.location
            far_m += math.hypot(there.x - points[-1][0], there.y - points[-1][1])
            points.append((there.x, there.y, far_m))
            if far_m > length_m:
                break
        return points

    def _met(self, way: list[tuple[float, float, float]], within_m: float) -> bool:
        """Whether a vehicle or a walker is on the way, so near."""
        place = self._vehicle.get_location()
        actors = self._world.get_actors()
        for actor in (*actors.filter("*vehicle*"), *actors.filter("*walker*")):
            if actor.id == self._vehicle.id:
                continue
            away_m = place.distance(actor.get_location())
            reach_m = _reach_m(actor)
            if away_m > within_m + reach_m:
                continue
            on_way = (_beside_m(actor, x, y) < ASIDE_M for x, y, far_m in way if far_m <= within_m)
            if not self._is_behind(actor) and any(on_way):
                return True
        return False

    def _is_behind(self, actor: Any) -> bool:
        transform = self._vehicle.get_transform()
        yaw = math.radians(transform.rotation.yaw)
        there = actor.get_location()
        dx, dy = there.x - transform.location.x, there.y - transform.location.y
        return math.cos(yaw) * dx + math.sin(yaw) * dy < 0.0

    def _red(self, way: list[tuple[float, float, float]], within_m: float) -> bool:
        """Whether a light that is not green has its stop line so near ahead on the way."""
        if self._lines is None:
            self._lines = [
                (light, stop.transform)
                for light in self._world.get_actors().filter("*traffic_light*")
                for stop in light.get_stop_waypoints()
            ]
        transform = self._vehicle.get_transform()
        green = carla_values().TrafficLightState.Green
        for light, stop in self._lines:
            if transform.location.distance(stop.location) > within_m + 1.0:
                continue
            turn = math.radians(stop.rotation.yaw - transform.rotation.yaw)
            near = [
                far_m
                for x, y, far_m in way
                if math.hypot(stop.location.x - x, stop.location.y - y) < LINE_M
            ]
            ahead = bool(near) and GONE_M < near[0] <= within_m
            if ahead and math.cos(turn) > 0.5 and light.get_state() != green:
                return True
        return False


def _reach_m(actor: Any) -> float:
    extent = actor.bounding_box.extent
    return math.hypot(extent.x, extent.y)


def _beside_m(actor: Any, x: float, y: float) -> float:
    """How far a place is from an actor's box [m]; 0 inside."""
    transform, extent = actor.get_transform(), actor.bounding_box.extent
    yaw = math.radians(transform.rotation.yaw)
    dx, dy = x - transform.location.x, y - transform.location.y
    ahead = abs(math.cos(yaw) * dx + math.sin(yaw) * dy) - extent.x
    right = abs(math.cos(yaw) * dy - math.sin(yaw) * dx) - extent.y
    return math.hypot(max(ahead, 0.0), max(right, 0.0))
