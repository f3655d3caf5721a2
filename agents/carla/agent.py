"""Drives with an agent that was written for the CARLA Leaderboard, its file unchanged.

`carla:path/to/agent.py` names the file, as CARLA's evaluator is given it. The agent is built anew
for every route, in the order of the Leaderboard that it was written for:

- 1.0: `Agent(config)`, which calls `setup(config)`; `sensors()`; `set_global_plan(gps, world)`.
- 2.x: `Agent(host, port, debug)`; `set_global_plan(gps, world)`; `setup(config)`; `sensors()`.

Then `run_step(input_data, timestamp)` every 0.05 s, and `destroy()` at the end. What is said behind
the file's name is in `agents.carla.options`. What an environment
must show follows from `sensors()`, so an agent is set up once more, without a route, before the
first one.
"""

from __future__ import annotations

import inspect
import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from agents.base import Control, Observation, Requirements, make_control
from agents.carla import data_provider
from agents.carla.events import EventMemory
from agents.carla.formats import input_data
from agents.carla.importing import entry_class
from agents.carla.options import CarlaOptions, folders_of
from agents.carla.plan import global_plan
from agents.one_thread import one_thread
from di_envs.sensors.carla_sensor import SensorSuiteError
from di_envs.sensors.carla_suite import CarlaSuite, suite_of
from di_envs.town.plan import RoutePlan

TICK_S = 0.05  # the Leaderboard's; an agent decides at every tick
HOST, PORT = "localhost", 2000  # CARLA's defaults, told to 2.x agents; nobody listens there


@dataclass(frozen=True, kw_only=True)
class CarlaMemory:
    """What we remember for an agent that hides the rest: how often it has decided."""

    decisions: int = 0
    origin: tuple[float, float]  # latitude, longitude [deg] of x = y = 0, by which GNSS counts
    events: EventMemory = field(default_factory=EventMemory)


class CarlaAgent:
    """An agent of the CARLA Leaderboard behind our contract.

    Not `branchable`: what it remembers is its own affair, so it is branched by replaying.

    Args:
        file: Its Python file, with `get_entry_point()`.
        config: Handed to its `setup`, unread; empty if there is none.
        leaderboard: `1.0`, `2.0` or `2.1`: which constructor it has, how sparse its route is and
            how many sensors it may have. None: 2.1 if its class has a constructor of its own that
            takes a host and a port, else 1.0.
        origin: Where on Earth GNSS has x = y = 0: `map`, or `LAT,LON`. None: 0, 0 for an agent of
            Leaderboard 1.0, what the map says for one of 2.x.
        limits: `leaderboard` to refuse sensors that the Leaderboard refuses.
        path: Folders, with commas between, from which the file's imports come first.
        track: `PRIVILEGED` for one that asks `CarlaDataProvider` for the truth.
    """

    def __init__(
        self,
        file: str,
        config: str = "",
        leaderboard: str | None = None,
        origin: str | None = None,
        limits: str = "none",
        path: str = "",
        track: str | None = None,
    ) -> None:
        self._options = CarlaOptions(
            config=config,
            leaderboard=leaderboard,
            origin=origin,
            limits=limits,
            path=folders_of(path),
            track=track,
        )
        self._class = entry_class(Path(file), config, self._options.path)
        self._config = config
        self._leaderboard = leaderboard or _leaderboard_of(self._class)
        self._origin = self._options.gnss_origin(self._leaderboard)
        self._requires: Requirements | None = None
        self._agent: Any = None
        self._suite: CarlaSuite | None = None

    @property
    def requires(self) -> Requirements:
        """What its `sensors()` need. Sets it up to find out, unless a route has begun."""
        if self._requires is None:
            try:
                agent, suite = self._built(None)
                agent.destroy()
            except (Exception, SystemExit) as error:
                warnings.warn(
                    f"{self._class.__name__} cannot be set up without a route: "
                    f"{type(error).__name__}: {error}. Every route will say so too.",
                    stacklevel=2,
                )
                suite = suite_of([])
            self._requires = self._requirements(suite)
        return self._requires

    def start(self, plan: RoutePlan, seed: int) -> CarlaMemory:
        """Builds it anew and hands it the route.

        Raises:
            SensorSuiteError: If its `sensors()` are refused. What its own code raises goes on.
        """
        self.close()
        data_provider.GameTime.show(0)
        self._agent, self._suite = self._built(plan)
        self._requires = self._requirements(self._suite)
        return CarlaMemory(origin=self._origin or plan.geo_origin)

    def act(self, observation: Observation, memory: CarlaMemory) -> tuple[Control, CarlaMemory]:
        """One `run_step`."""
        if self._agent is None or self._suite is None:
            raise RuntimeError("there is no route to drive; call start(plan, seed) first")
        # CARLA counts a tick before it asks its agent, so the first one is at 0.05 s
        frame = memory.decisions + 1
        data = input_data(self._suite, observation, frame, memory.origin, memory.events)
        self._agent.sensor_interface.deliver(data, frame * TICK_S)
        data_provider.GameTime.show(frame)
        data_provider.show(observation.get("world"))
        with one_thread():
            control = control_of(self._agent())
        return control, replace(memory, decisions=frame, events=memory.events.after(observation))

    def close(self) -> None:
        """Lets it `destroy` what it holds."""
        agent, self._agent = self._agent, None
        data_provider.show(None)
        if agent is not None:
            agent.destroy()

    def _requirements(self, suite: CarlaSuite) -> Requirements:
        counted = {} if self._origin is None else {"gnss_origin": self._origin}
        return Requirements(
            observations=suite.observations,
            control_dt_s=TICK_S,
            options={**suite.options, **(counted if "inertial" in suite.observations else {})},
            hd_map=suite.with_map or suite.track.startswith("MAP"),
            privileged=self._options.track == "PRIVILEGED",
            branchable=False,
        )

    def _built(self, plan: RoutePlan | None) -> tuple[Any, CarlaSuite]:
        """A fresh agent and its sensors; without a plan it is told none."""
        routes = None if plan is None else global_plan(plan, self._origin)
        if self._leaderboard == "1.0":
            agent = self._class(self._config)
        else:
            agent = self._class(HOST, PORT, False)
        if not hasattr(getattr(agent, "sensor_interface", None), "deliver"):
            raise TypeError(
                f"{self._class.__name__} must derive from leaderboard.autoagents.autonomous_agent."
                f"AutonomousAgent, and its __init__ must call super().__init__(...)"
            )
        if self._leaderboard != "1.0":
            if routes is not None:
                agent.set_global_plan(*routes)
            agent.setup(self._config)
        suite = _suite_of_agent(agent, self._leaderboard, self._options.limits)
        if self._leaderboard == "1.0" and routes is not None:
            agent.set_global_plan(*routes)
        return agent, suite


def control_of(given: Any) -> Control:
    """A control of `carla.VehicleControl`, or of any object with its fields.

    The hand brake is taken for the brake. There is no reverse gear: who asks for it stands still.

    Raises:
        TypeError: If it has no `throttle`, `steer` and `brake`.
        ValueError: If one of them is NaN.
    """
    try:
        throttle, steer, brake = (
            float(getattr(given, name)) for name in ("throttle", "steer", "brake")
        )
    except (AttributeError, TypeError, ValueError):
        raise TypeError(
            f"run_step returned {given!r}; expected a carla.VehicleControl, or an object with "
            f"numbers throttle, steer and brake"
        ) from None
    if getattr(given, "reverse", False):
        warnings.warn("the agent asks for reverse gear; there is none: it brakes", stacklevel=2)
        throttle, brake = 0.0, 1.0
    if getattr(given, "hand_brake", False):
        throttle, brake = 0.0, 1.0
    return make_control(throttle, steer, brake)


def _suite_of_agent(agent: Any, leaderboard: str, limits: str) -> CarlaSuite:
    """What its `sensors()` ask for, on the track that it says."""
    track = getattr(agent, "track", "SENSORS")
    name = str(getattr(track, "value", track))
    try:
        sensors = agent.sensors()
    except (Exception, SystemExit) as error:
        raise SensorSuiteError(f"sensors() raised {type(error).__name__}: {error}") from error
    return suite_of(sensors, name, leaderboard, limits)


def _leaderboard_of(agent: type[Any]) -> str:
    """By the constructor: one that takes a host and a port is that of a 2.x agent."""
    owner = next(base for base in agent.__mro__ if "__init__" in vars(base))
    if owner.__module__.partition(".")[0] == "leaderboard":
        return "1.0"  # the base class takes both
    needed = [
        parameter
        for parameter in list(inspect.signature(vars(owner)["__init__"]).parameters.values())[1:]
        if parameter.kind is parameter.POSITIONAL_OR_KEYWORD
    ]
    return "2.1" if len(needed) > 1 and needed[1].default is inspect.Parameter.empty else "1.0"
