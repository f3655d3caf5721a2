"""`CarlaDataProvider` for agents that ask it, read-only: the true world, on track PRIVILEGED alone.

It stands at `srunner.scenariomanager.carla_data_provider` for an agent's imports. As CARLA's it is
one for its process, which drives one agent at a time; `CarlaAgent` shows it the world at each step.
An agent of another track may import it, and is told nothing: its process has nothing to tell.
"""

from __future__ import annotations

from datetime import datetime, timedelta, timezone
from types import SimpleNamespace
from typing import Any

from agents.carla.missing import say_missing
from agents.carla.true_actors import ActorList, Body, Light, bodies_of, signals_of
from agents.carla.true_map import TrueMap
from di_envs.world.kinds import TICK_S
from di_envs.world.world import WorldView


class NoTruthError(RuntimeError):
    """An agent asks for the true world that may not know it."""


class TrueWorld:
    """What `carla.World` tells: who is there, and what the time is."""

    def __init__(self, view: WorldView) -> None:
        self._view, self._map = view, TrueMap(view.town)

    def __getattr__(self, name: str) -> Any:
        return say_missing(self, name)

    @property
    def view(self) -> WorldView:
        """The state itself."""
        return self._view

    def get_map(self) -> TrueMap:
        """The map."""
        return self._map

    def get_actors(self, actor_ids: Any = None) -> ActorList:
        """All actors, the ego first, signals last; or those of some ids."""
        found = [*bodies_of(self, self._view), *signals_of(self, self._view)]
        if actor_ids is None:
            return ActorList(found)
        wanted = set(actor_ids)
        return ActorList([actor for actor in found if actor.id in wanted])

    def get_actor(self, actor_id: int) -> Any:
        """The actor of a number; None if there is none."""
        return self.get_actors().find(actor_id)

    def get_snapshot(self) -> Any:
        """The present moment: its frame and time."""
        tick = int(self._view.state.tick)
        seconds = tick * TICK_S
        stamp = SimpleNamespace(frame=tick, elapsed_seconds=seconds, delta_seconds=TICK_S)
        return SimpleNamespace(frame=tick, timestamp=stamp)

    def get_settings(self) -> Any:
        """20 ticks a second, in step with the agent."""
        return SimpleNamespace(synchronous_mode=True, fixed_delta_seconds=TICK_S)


_shown: dict[str, TrueWorld] = {}  # at most one, under "now"


def show(view: WorldView | None) -> None:
    """Tells the provider of the world that a privileged agent may ask for; None for none."""
    if view is None:
        _shown.clear()
    elif "now" not in _shown or _shown["now"].view is not view:
        _shown["now"] = TrueWorld(view)


def _world() -> TrueWorld:
    if "now" not in _shown:
        raise NoTruthError(
            "CarlaDataProvider tells the truth, from the first run_step on, and only to an agent "
            "that may know it: name it as carla:FILE?track=PRIVILEGED, and its result says so."
        )
    return _shown["now"]


class _Missing(type):
    def __getattr__(cls, name: str) -> Any:
        return say_missing(cls, name)


class CarlaDataProvider(metaclass=_Missing):
    """What ScenarioRunner's tells, as far as it is known here."""

    @staticmethod
    def get_world() -> TrueWorld:
        """The world."""
        return _world()

    @staticmethod
    def get_map(world: Any = None) -> TrueMap:
        """Its map."""
        return _world().get_map()

    @staticmethod
    def get_hero_actor() -> Body:
        """The ego."""
        world = _world()
        return Body(world, world.view, world.view.ego)

    @staticmethod
    def get_all_actors() -> ActorList:
        """Everybody."""
        return _world().get_actors()

    @staticmethod
    def get_actors() -> list[tuple[int, Any]]:
        """Everybody on the roads, each with a number."""
        return [(actor.id, actor) for actor in bodies_of(_world(), _world().view)]

    @staticmethod
    def get_actor_by_id(actor_id: int) -> Any:
        """One of them; None if there is none."""
        return _world().get_actor(actor_id)

    @staticmethod
    def get_velocity(actor: Any) -> float:
        """An actor's speed [m/s]."""
        return float(actor.get_velocity().length())

    @staticmethod
    def get_location(actor: Any) -> Any:
        """Where an actor is."""
        return actor.get_location()

    @staticmethod
    def get_transform(actor: Any) -> Any:
        """Where an actor is, and how it is turned."""
        return actor.get_transform()

    @staticmethod
    def get_next_traffic_light(actor: Any, use_cached_location: bool = True) -> Light | None:
        """The light at the end of the lane that an actor is on, or of the ones it comes to next."""
        waypoint = actor.get_world().get_map().get_waypoint(actor.get_location())
        lights = {
            (stop.road_id, stop.section_id, stop.lane_id): light
            for light in actor.get_world().get_actors().filter("*traffic_light*")
            for stop in light.get_stop_waypoints()
        }
        for _ in range(50):  # 100 m, straight on
            if waypoint is None or waypoint.is_junction:
                return None
            found = lights.get((waypoint.road_id, waypoint.section_id, waypoint.lane_id))
            if found is not None:
                return found
            waypoint = next(iter(waypoint.next(2.0)), None)
        return None

    @staticmethod
    def is_sync_mode() -> bool:
        """It is."""
        return True

    @staticmethod
    def get_frame_rate() -> float:
        """Ticks a second."""
        return 1.0 / TICK_S

    @staticmethod
    def get_weather() -> Any:
        """Not told: cameras show it, and its name is an option of the run."""
        raise NoTruthError("the weather is not told; it is an option of the run (--weather)")


class GameTime:
    """The time that an agent is told with its data: seconds and ticks since the route began.

    No clock runs: the wall-clock time is the game's, from a fixed day on.
    """

    _frame = 0

    @classmethod
    def show(cls, frame: int) -> None:
        """Sets the tick."""
        cls._frame = frame

    @classmethod
    def get_time(cls) -> float:
        """Seconds."""
        return cls._frame * TICK_S

    get_carla_time = get_time

    @classmethod
    def get_frame(cls) -> int:
        """Ticks."""
        return cls._frame

    @classmethod
    def get_wallclocktime(cls) -> datetime:
        """The game's time on 1 January 2000."""
        return datetime(2000, 1, 1, tzinfo=timezone.utc) + timedelta(seconds=cls.get_time())
