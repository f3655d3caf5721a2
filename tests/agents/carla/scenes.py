"""A scene to look at by arithmetic: an ego far outside its town that faces east, and one car."""

from __future__ import annotations

from agents.carla.events import EventMemory
from agents.carla.formats import input_data
from di_envs.observer import Observer
from di_envs.suites import load_suite
from di_envs.town.loading import load_town
from di_envs.world.state import ActorKind, views_of
from di_envs.world.world import World, WorldConfig

AT_M = 600.0  # x and y of the ego


def put(world, actor, x, y, yaw=0.0, **fields):
    """Places an actor, metres and radians."""
    snapshot = world.save()
    state = views_of(snapshot.record)
    for name, value in {"x": x, "y": y, "z": 0.0, "yaw": yaw, **fields}.items():
        getattr(state, name)[actor] = value
    world.restore(snapshot)


class Scene:
    """The ego drives at 3 m/s."""

    def __init__(self):
        suite = load_suite("town05_short")
        self.town = load_town(suite.town_path, suite.signals)
        self.world = World(self.town, WorldConfig(vehicles=1, walkers=0))
        self.world.reset(0, suite.plans(self.town, ["10"]))
        put(self.world, 0, AT_M, AT_M, speed=3.0)

    def seen(self, suite, x, y, *, kind=ActorKind.CAR, before=EventMemory(), **fields):  # noqa: B008
        """What a suite says with the car so far ahead and to the right of the ego."""
        put(self.world, 1, AT_M + x, AT_M + y, kind=int(kind), **fields)
        observer = Observer(self.town, suite.observations, **suite.options)
        observer.start(self.world.view)
        observation = {**observer.observe(), "town": self.town}
        return observation, input_data(suite, observation, 7, self.town.geo_origin, before)
