"""Scenes made by hand in the toy town, so that a test can say where everything stands."""

from __future__ import annotations

import numpy as np

from di_envs.observer import Observer
from di_envs.suites import load_suite
from di_envs.town.loading import load_town
from di_envs.world.state import ActorKind, Capacity, state_dtype, views_of
from di_envs.world.world import WorldView

VEHICLES = 40


def toy_town():
    suite = load_suite("toy")
    return load_town(suite.town_path, suite.signals)


def toy_plan(town, route_id="1"):
    return load_suite("toy").plans(town, [route_id])[0]


class Scene:
    """A world's view whose state can be written: one ego, and vehicles where a test puts them."""

    def __init__(self, town, plan):
        self.capacity = Capacity(
            egos=1,
            vehicles=VEHICLES,
            walkers=0,
            props=0,
            junctions=town.signals.groups.size,
            signals=town.signals.kind.size,
        )
        self.town, self.plan = town, plan
        self.record = np.zeros(1, state_dtype(self.capacity))
        self.state = views_of(self.record)
        self.put(0, *plan.points[0])

    def put(self, actor, x, y, z=0.0, yaw=0.0, speed=0.0, kind=ActorKind.CAR):
        """Places an actor: metres, radians, m/s; cars of 4 m by 2 m."""
        values = {"x": x, "y": y, "z": z, "yaw": yaw, "speed": speed, "kind": kind}
        values |= {"half_length": 2.0, "half_width": 1.0}
        for name, value in values.items():
            getattr(self.state, name)[actor] = value

    def observe(self, groups=("prompt",), **changes):
        """What the ego sees; `changes` replace the view's town or plan."""
        town, plan = changes.get("town", self.town), changes.get("plan", self.plan)
        read_only = views_of(self.record)
        for array in read_only:
            array.flags.writeable = False  # as the world's own view has them
        observer = Observer(town, groups)
        observer.start(WorldView(town=town, state=read_only, plans=(plan,), capacity=self.capacity))
        return observer.observe()
