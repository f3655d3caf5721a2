"""The base class of agents for the CARLA Leaderboard, with the constructors of 1.0 and of 2.x.

An agent's file imports it from here as it does from CARLA's own package, so that it runs in both;
`--agent carla:FILE` drives it (see `agents.carla.agent`).
Source: interface of the Leaderboard's branches `leaderboard-1.0` and `leaderboard-2.1` (MIT
licence); our own code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any

from agents.carla.data_provider import CarlaDataProvider, NoTruthError
from leaderboard.envs.sensor_interface import SensorInterface
from leaderboard.utils.route_manipulation import downsample_route

TARGET_SPACING_M = {"1.0": 50.0, "2.x": 200.0}  # Bench2Drive has 50 m in its fork of 2.x


class Track(Enum):
    """Which sensors an agent may use; the qualifiers are of 2.x and allow fewer of them."""

    SENSORS = "SENSORS"
    MAP = "MAP"
    SENSORS_QUALIFIER = "SENSORS_QUALIFIER"
    MAP_QUALIFIER = "MAP_QUALIFIER"


class AutonomousAgent:
    """Derive from it: say your `track` in `setup`, your `sensors`, and drive in `run_step`.

    Attributes:
        track: One of `Track`.
        sensor_interface: Where the sensors' data arrive.
        hero_actor: None; agents of some forks keep the ego there.
    """

    def __init__(self, *given: Any, **named: Any) -> None:
        """`(path_to_conf_file)` as 1.0 calls it, or `(carla_host, carla_port, debug)` as 2.x.

        In 1.0 the constructor calls `setup`; in 2.x whoever made the agent does.
        """
        is_first = len(given) + len(named) <= 1
        self.track = Track.SENSORS
        self._global_plan: list[tuple[Mapping[str, float], Any]] | None = None
        self._global_plan_world_coord: list[tuple[Any, Any]] | None = None
        self._target_spacing_m = TARGET_SPACING_M["1.0" if is_first else "2.x"]
        self.sensor_interface = SensorInterface()
        self.wallclock_t0 = None
        self.hero_actor: Any = None
        if is_first:
            self.setup(*given, **named)

    def setup(self, path_to_conf_file: str) -> None:
        """Prepares the agent: its `track`, its weights."""

    def sensors(self) -> Sequence[Mapping[str, Any]]:
        """The sensors that it wants: dicts with `type`, `id`, and place and angles where needed.

        Metres and degrees in the ego's frame: x ahead, y right, z up; pitch up, yaw right.
        """
        return []

    def run_step(self, input_data: Mapping[str, tuple[int, Any]], timestamp: float) -> Any:
        """Decides.

        Args:
            input_data: By sensor id, the frame and its data (formats: `agents.carla.formats`).
            timestamp: Seconds of game time since the route began.

        Returns:
            A `carla.VehicleControl`, or any object with its fields.
        """
        raise NotImplementedError(f"{type(self).__name__} has no run_step(input_data, timestamp)")

    def destroy(self) -> None:
        """Frees what the agent holds."""

    def set_global_plan(
        self,
        global_plan_gps: Sequence[tuple[Mapping[str, float], Any]],
        global_plan_world_coord: Sequence[tuple[Any, Any]],
    ) -> None:
        """Keeps the sparse points of a dense route: 50 m apart at most in 1.0, 200 m in 2.x."""
        kept = downsample_route(global_plan_world_coord, self._target_spacing_m)
        self._global_plan = [global_plan_gps[index] for index in kept]
        self._global_plan_world_coord = [global_plan_world_coord[index] for index in kept]

    def get_metric_info(self) -> dict[str, list[float]]:
        """What Bench2Drive's agents note at each step for its metrics: truths about the ego.

        Returns:
            `acceleration`, `angular_velocity`, `forward_vector`, `right_vector`, `location` (x, y,
            z) and `rotation` (roll, pitch, yaw), in CARLA's units; NaN but for privileged agents.
        """
        names = ("acceleration", "angular_velocity", "forward_vector", "right_vector", "location")
        try:
            hero = CarlaDataProvider.get_hero_actor()
        except NoTruthError:
            return {name: [math.nan] * 3 for name in (*names, "rotation")}
        place = hero.get_transform()
        found = (
            hero.get_acceleration(),
            hero.get_angular_velocity(),
            place.get_forward_vector(),
            place.get_right_vector(),
            place.location,
        )
        told = {name: [v.x, v.y, v.z] for name, v in zip(names, found, strict=True)}
        turn = place.rotation
        return {**told, "rotation": [turn.roll, turn.pitch, turn.yaw]}

    @staticmethod
    def get_ros_version() -> int:
        """-1: it is no node of ROS."""
        return -1

    def __call__(self) -> Any:
        """One `run_step` on the data that have arrived."""
        return self.run_step(self.sensor_interface.get_data(), self.sensor_interface.timestamp_s)
