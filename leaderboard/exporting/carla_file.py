"""Drives with an agent of DriveInsight in the CARLA Leaderboard; written by `export-agent`.

Give this file to the Leaderboard's `--agent`, and `agent.json` beside it to `--agent-config`. It
runs on CARLA's Python (3.7 and later) and needs NumPy. The agent itself drives in a process of its
own, on the Python that `agent.json` names, where DriveInsight is installed: so CARLA's packages
`agents` and `leaderboard` and DriveInsight's do not meet.

`agent.json` says whether the agent is told of others, of lights and of the map. That is asked of
`CarlaDataProvider`, which the Leaderboard allows nobody: say so with its result.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import subprocess
from pathlib import Path
from typing import Any

import carla
import numpy as np

from leaderboard.autoagents.autonomous_agent import AutonomousAgent, Track

SETTINGS = "agent.json"
FORMAT = 1
REACH_M = 100.0  # within which others are told of
START = "import sys; from agents.carla.exported.seat import main; main(sys.argv[1])"
KINDS = {"car": 1, "van": 2, "truck": 3, "bus": 4, "motorcycle": 5, "bicycle": 6}
WALKER, DEBRIS, VENDING_MACHINE = 7, 9, 10
FLAT_M = 0.3  # half the height below which what lies on the road can be driven over
LONG_M = 2.75  # half the length above which a vehicle of no known kind is a truck
BICYCLES = ("bh", "diamondback", "gazelle")  # makers in CARLA's library of vehicles
LIGHTS = {"Green": 1, "Yellow": 2, "Red": 3}


def get_entry_point() -> str:
    """The Leaderboard asks for the name of the class."""
    return "ExportedAgent"


class ExportedAgent(AutonomousAgent):
    """Hands what CARLA says to the agent, and its control to CARLA."""

    _settings: Any = None
    _dense: Any = None
    _policy: Any = None

    def setup(self, path_to_conf_file: str) -> None:
        """Reads the settings."""
        self.track = Track.SENSORS
        given = Path(path_to_conf_file or "")
        path = given if given.is_file() else Path(__file__).resolve().parent / SETTINGS
        self._folder = path.resolve().parent
        self._settings = json.loads(path.read_text(encoding="utf-8"))
        if self._settings["format"] != FORMAT:
            raise ValueError(f"{path} is of another version: export the agent again")
        self._tick = 0
        self._begin()

    def sensors(self) -> Any:
        """Those that the agent was trained with."""
        return self._settings["sensors"]

    def set_global_plan(self, global_plan_gps: Any, global_plan_world_coord: Any) -> None:
        """Keeps the route, all of whose points the agent is told."""
        super().set_global_plan(global_plan_gps, global_plan_world_coord)
        self._dense = (list(global_plan_gps), list(global_plan_world_coord))
        self._begin()

    def _begin(self) -> None:
        """Starts the agent once settings and route are there: each comes first in some version."""
        if self._settings is not None and self._dense is not None:
            self._policy = Policy(self._settings, self._folder)

    def run_step(self, input_data: Any, timestamp: float) -> Any:
        """One tick."""
        provider = _provider() if self._settings["told"] else None
        if self._tick == 0:
            self._policy.ask(*self._route(provider))
        decides = self._tick % self._settings["ticks_a_decision"] == 0
        self._tick += 1
        values: Any = {"ask": "tick"}
        arrays: Any = {}
        for id_, (_, data) in input_data.items():
            if id_ == "speed":
                values["speed"] = float(data["speed"])
            elif decides or not id_.startswith("camera"):
                arrays[id_] = np.asarray(data)
        if provider is not None:
            hero = provider.get_hero_actor()
            arrays["hero"] = np.array(_place(hero.get_transform()), np.float64)
            if decides:
                actors = provider.get_world().get_actors()
                arrays["actors"] = _others(actors, hero)
                arrays["lights"] = _lights(actors)
        throttle, steer, brake = self._policy.ask(values, arrays)["control"]
        control = carla.VehicleControl()
        control.throttle, control.steer, control.brake = throttle, steer, brake
        return control

    def _route(self, provider: Any) -> Any:
        """The message with which a route begins."""
        gps, world = self._dense
        values: Any = {"ask": "start"}
        if provider is not None:
            town = provider.get_map()
            values["map"], values["opendrive"] = town.name, town.to_opendrive()
        return values, {
            "points": np.array([_place(place) for place, _ in world], np.float64),
            "option": np.array([int(getattr(o, "value", o)) for _, o in world], np.int64),
            "gps": np.array([[point["lat"], point["lon"]] for point, _ in gps], np.float64),
        }

    def destroy(self) -> None:
        """Ends the agent's process."""
        policy, self._policy = self._policy, None
        if policy is not None:
            policy.close()


class Policy:
    """The process in which the agent drives."""

    def __init__(self, settings: Any, folder: Path) -> None:
        environment = dict(os.environ, PYTHONPATH=settings["packages"])
        command = [settings["python"], "-c", START, settings["agent"]]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=str(folder), env=environment
        )
        self._answer()

    def ask(self, values: Any, arrays: Any) -> Any:
        """A message, and the answer to it."""
        arrays = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
        values["arrays"] = [[name, a.dtype.str, list(a.shape)] for name, a in arrays.items()]
        stream: Any = self._process.stdin
        try:
            stream.write(json.dumps(values).encode() + b"\n")
            for array in arrays.values():
                stream.write(array.tobytes())
            stream.flush()
        except BrokenPipeError:
            pass  # it says why in its last answer
        return self._answer()

    def _answer(self) -> Any:
        stream: Any = self._process.stdout
        line = stream.readline()
        if not line:
            raise RuntimeError(f"the agent's process ended: exit code {self._process.wait()}")
        answer = json.loads(line)
        if "fault" in answer:
            raise RuntimeError("the agent failed: " + answer["fault"])
        return answer

    def close(self) -> None:
        """Lets it end."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()
        self._process.wait()


def _provider() -> Any:
    """ScenarioRunner's `CarlaDataProvider`, which knows the truth."""
    module = importlib.import_module("srunner.scenariomanager.carla_data_provider")
    return module.CarlaDataProvider


def _place(transform: Any) -> Any:
    """x, y, z [m], yaw [rad]."""
    place = transform.location
    return [place.x, place.y, place.z, math.radians(transform.rotation.yaw)]


def _others(actors: Any, hero: Any) -> Any:
    """(N, 8) vehicles, walkers and things on the road: place, yaw, speed, half sizes, kind."""
    here = hero.get_transform().location
    rows = []
    for pattern in ("vehicle.*", "walker.*", "static.prop*"):
        for actor in actors.filter(pattern):
            x, y, z, yaw = _place(actor.get_transform())
            if actor.id == hero.id or math.hypot(x - here.x, y - here.y) > REACH_M:
                continue
            velocity, extent = actor.get_velocity(), actor.bounding_box.extent
            speed = velocity.x * math.cos(yaw) + velocity.y * math.sin(yaw)
            rows.append([x, y, z, yaw, speed, extent.x, extent.y, _kind(actor, extent)])
    return np.array(rows, np.float64).reshape(-1, 8)


def _kind(actor: Any, extent: Any) -> int:
    """Which kind of DriveInsight's an actor is."""
    parts = actor.type_id.split(".")
    if parts[0] == "walker":
        return WALKER
    if parts[0] == "static":
        return DEBRIS if extent.z < FLAT_M else VENDING_MACHINE
    said = actor.attributes.get("base_type", "").lower()
    for name in (said, parts[1]):
        if name in KINDS:
            return KINDS[name]
    if actor.attributes.get("number_of_wheels") == "2":
        return KINDS["bicycle" if parts[1] in BICYCLES else "motorcycle"]
    return KINDS["truck" if extent.x > LONG_M else "car"]


def _lights(actors: Any) -> Any:
    """(L, 3) the middle of each light's box on the road, x, y [m], and what it shows."""
    rows = []
    for light in actors.filter("*traffic_light*"):
        x, y, _, yaw = _place(light.get_transform())
        box = light.trigger_volume.location
        shown = LIGHTS.get(str(light.get_state()).rpartition(".")[2], 0)
        ahead, right = math.cos(yaw), math.sin(yaw)
        rows.append([x + ahead * box.x - right * box.y, y + right * box.x + ahead * box.y, shown])
    return np.array(rows, np.float64).reshape(-1, 3)
