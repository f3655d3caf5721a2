"""The true world as CARLA's actors, read-only: vehicles, people, lights and signs.

Only privileged agents are given it. An actor is a look at the state: it shows the present one until
the episode's end.
"""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Iterator, Sequence
from typing import Any

from agents.carla.events import TYPE_IDS
from agents.carla.missing import say_missing
from agents.carla.true_map import TrueMap, Waypoint
from agents.carla.values import carla_values
from di_envs.town.lanes import LightState, SignalKind
from di_envs.world.kinds import ActorKind
from di_envs.world.world import WorldView

FIRST_SIGNAL = 1_000_000  # ids of signals count from here, those of actors from 1
_KPH = 3.6
_SHOWS = {
    LightState.RED: "Red",
    LightState.YELLOW: "Yellow",
    LightState.GREEN: "Green",
    LightState.NONE: "Off",
}


class _Actor:
    """What every actor has.

    Attributes:
        id: Its number.
        type_id: Such as `vehicle.car`.
        attributes: `role_name` is `hero` for the ego.
        is_alive: Always.
    """

    def __init__(self, world: Any, id_: int, type_id: str, role: str) -> None:
        self._world, self.id, self.type_id = world, id_, type_id
        self.attributes = {"role_name": role}
        self.is_alive, self.parent = True, None

    def __getattr__(self, name: str) -> Any:
        return say_missing(self, name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Actor) and self.id == other.id

    def __hash__(self) -> int:
        return self.id

    def get_world(self) -> Any:
        """The world that it is in."""
        return self._world

    def get_location(self) -> Any:
        """Where it is."""
        return self.get_transform().location


class Body(_Actor):
    """A vehicle, a walker, or what stands on the road."""

    def __init__(self, world: Any, view: WorldView, index: int) -> None:
        kind = ActorKind(int(view.state.kind[index]))
        hero = "hero" if index == view.ego else "autopilot"
        super().__init__(world, index + 1, TYPE_IDS[kind], hero)
        self._view, self._index = view, index

    def _of(self, field: str) -> float:
        return float(getattr(self._view.state, field)[self._index])

    def get_transform(self) -> Any:
        """Its place on the ground, and how it is turned."""
        carla = carla_values()
        place = carla.Location(x=self._of("x"), y=self._of("y"), z=self._of("z"))
        turn = math.degrees(math.remainder(self._of("yaw"), 2.0 * math.pi))
        return carla.Transform(place, carla.Rotation(yaw=turn))

    def get_velocity(self) -> Any:
        """Metres a second in the world frame."""
        return self._along(self._of("speed"))

    def get_acceleration(self) -> Any:
        """Along its heading [m/s2], in the world frame."""
        return self._along(self._of("acceleration"))

    def _along(self, value: float) -> Any:
        yaw = self._of("yaw")
        return carla_values().Vector3D(x=value * math.cos(yaw), y=value * math.sin(yaw), z=0.0)

    def get_angular_velocity(self) -> Any:
        """Degrees a second."""
        return carla_values().Vector3D(x=0.0, y=0.0, z=math.degrees(self._of("yaw_rate")))

    @property
    def bounding_box(self) -> Any:
        """Its box, in its own frame."""
        carla, high = carla_values(), 0.5 * self._of("height")
        extent = carla.Vector3D(x=self._of("half_length"), y=self._of("half_width"), z=high)
        return carla.BoundingBox(carla.Location(x=0.0, y=0.0, z=high), extent)

    def get_control(self) -> Any:
        """What the ego's driver holds; of others nothing is known: all zero."""
        control = carla_values().VehicleControl()
        if self._index < len(self._view.plans):
            for name in ("throttle", "steer", "brake"):
                setattr(control, name, self._of(name))
        return control

    def get_speed_limit(self) -> float:
        """Kilometres an hour, of its lane; 0 off the lanes."""
        lane = int(self._of("lane"))
        limits = self._view.town.lanes.speed_limit_mps
        return 0.0 if lane < 0 else _KPH * float(limits[lane])

    def get_traffic_light(self) -> Light | None:
        """The light before whose line it is, within the light's box; None if there is none."""
        lane, town = int(self._of("lane")), self._view.town
        line = -1 if lane < 0 else int(town.lanes.stop_line[lane])
        if line < 0:
            return None
        signal = int(town.signals.stop_signal[line])
        if int(town.signals.kind[signal]) != SignalKind.LIGHT or not self._within(signal):
            return None
        return Light(self._world, self._view, signal)

    def _within(self, signal: int) -> bool:
        x, y, _, yaw, half_x, half_y = self._view.town.signals.box[signal].tolist()
        dx, dy = self._of("x") - x, self._of("y") - y
        ahead = math.cos(yaw) * dx + math.sin(yaw) * dy
        right = math.cos(yaw) * dy - math.sin(yaw) * dx
        return abs(ahead) <= half_x + self._of("half_length") and abs(right) <= half_y

    def is_at_traffic_light(self) -> bool:
        """Whether there is such a light."""
        return self.get_traffic_light() is not None

    def get_traffic_light_state(self) -> Any:
        """What that light shows; green where there is none, as in CARLA."""
        light = self.get_traffic_light()
        return carla_values().TrafficLightState.Green if light is None else light.get_state()


class Signal(_Actor):
    """A light or a sign, and the lines that it rules."""

    def __init__(self, world: Any, view: WorldView, signal: int, type_id: str) -> None:
        super().__init__(world, FIRST_SIGNAL + signal, type_id, "")
        self._view, self._signal = view, signal

    def get_transform(self) -> Any:
        """The foot of its pole, turned as the traffic that it faces."""
        x, y, z, yaw = self._view.town.signals.pose[self._signal].tolist()
        carla = carla_values()
        return carla.Transform(carla.Location(x=x, y=y, z=z), carla.Rotation(yaw=math.degrees(yaw)))

    def get_stop_waypoints(self) -> list[Waypoint]:
        """The ends of the lanes that it rules: where to stop."""
        town = self._view.town
        lines = (town.signals.stop_signal == self._signal).nonzero()[0].tolist()
        lanes = [int(town.signals.stop_lane[line]) for line in lines]
        town_map: TrueMap = self._world.get_map()
        return [Waypoint(town_map, lane, float(town.lanes.length_m[lane])) for lane in lanes]

    get_affected_lane_waypoints = get_stop_waypoints

    @property
    def trigger_volume(self) -> Any:
        """Its box on the road, in its own frame."""
        x, y, z, _, half_x, half_y = self._view.town.signals.box[self._signal].tolist()
        foot_x, foot_y, foot_z, yaw = self._view.town.signals.pose[self._signal].tolist()
        c, s, carla = math.cos(yaw), math.sin(yaw), carla_values()
        dx, dy = x - foot_x, y - foot_y
        place = carla.Location(x=c * dx + s * dy, y=c * dy - s * dx, z=z - foot_z)
        return carla.BoundingBox(place, carla.Vector3D(x=half_x, y=half_y, z=1.0))


class Light(Signal):
    """A traffic light."""

    def __init__(self, world: Any, view: WorldView, signal: int) -> None:
        super().__init__(world, view, signal, "traffic.traffic_light")

    def get_state(self) -> Any:
        """`carla.TrafficLightState`."""
        shown = LightState(int(self._view.state.light[self._signal]))
        return getattr(carla_values().TrafficLightState, _SHOWS[shown])

    @property
    def state(self) -> Any:
        """The same."""
        return self.get_state()


class ActorList(Sequence[Any]):
    """Actors, to be filtered by their type."""

    def __init__(self, actors: Sequence[Any]) -> None:
        self._actors = tuple(actors)

    def __len__(self) -> int:
        return len(self._actors)

    def __getitem__(self, index: Any) -> Any:
        return self._actors[index]

    def __iter__(self) -> Iterator[Any]:
        return iter(self._actors)

    def filter(self, pattern: str) -> ActorList:
        """Those whose `type_id` matches, such as `*vehicle*`."""
        found = [actor for actor in self._actors if fnmatch.fnmatch(actor.type_id, pattern)]
        return ActorList(found)

    def find(self, id_: int) -> Any:
        """The one of that number; None if there is none."""
        return next((actor for actor in self._actors if actor.id == id_), None)


def bodies_of(world: Any, view: WorldView) -> list[Body]:
    """Everything that there is on the roads and beside them, by index."""
    there = (view.state.kind != ActorKind.ABSENT).nonzero()[0].tolist()
    return [Body(world, view, index) for index in there]


def signals_of(world: Any, view: WorldView) -> list[Signal]:
    """Lights, and stop and yield signs."""
    names = {SignalKind.STOP: "traffic.stop", SignalKind.YIELD: "traffic.yield"}
    found: list[Signal] = []
    for signal, kind in enumerate(view.town.signals.kind.tolist()):
        if kind == SignalKind.LIGHT:
            found.append(Light(world, view, signal))
        else:
            found.append(Signal(world, view, signal, names[SignalKind(kind)]))
    return found
