"""An agent of ours in its seat in CARLA: from what CARLA's sensors say to its control.

`serve` is the process's life: a message at a time, each with an answer. The file that sends them is
`leaderboard/exporting/carla_file.py`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from agents import load_agent
from agents.carla.exported.lidar import Pose, thinned, whole_turn
from agents.carla.exported.pipe import read_message, write_message
from agents.carla.exported.place import Globe, Reckoning
from agents.carla.exported.sensors import ticks_a_decision, told_by
from agents.carla.exported.told import Told, plan_of_route, town_of_text
from agents.faults import describe
from di_envs.sensors.camera.config import rig_of
from di_envs.sensors.lidar.config import LidarConfig, lidar_of

Arrays = Mapping[str, NDArray[Any]]


class Seat:
    """The agent, where it has come to, and what it remembers.

    Args:
        spec: Of the agent, as `agents.load_agent` takes it.
    """

    def __init__(self, spec: str) -> None:
        self._agent = load_agent(spec)
        requires = self._agent.requires
        self._told_names = told_by(self._agent)
        self._every = ticks_a_decision(spec, requires)
        self._groups, options = requires.observations, requires.options
        self._rig = rig_of(options.get("cameras", "small")) if "camera" in self._groups else None
        self._lidar: LidarConfig | None = None
        if "lidar" in self._groups:
            self._lidar = lidar_of(options.get("lidar", "paper"))
        self._tick = -1

    def start(self, values: Mapping[str, Any], arrays: Arrays) -> dict[str, Any]:
        """A route begins: `points`, `option` and `gps` of its dense points; the map, if told."""
        points = arrays["points"]
        plan = plan_of_route(points, arrays["option"])
        text = values.get("opendrive")
        self._told = Told(plan, None if text is None else town_of_text(values["map"], text))
        self._globe = Globe.of_route(arrays["gps"], points[:, :2])
        x, y, _, yaw = points[0].tolist()
        self._reckoning = Reckoning.at(x, y, yaw)
        self._memory = self._agent.start(plan, 0)
        self._tick, self._half = -1, (np.zeros((0, 4), np.float32), (x, y, yaw))
        return {}

    def tick(self, values: Mapping[str, Any], arrays: Arrays) -> dict[str, Any]:
        """A tick: sensors' data by their ids; `hero`, `actors` and `lights` where they are told."""
        self._tick += 1
        speed_mps, imu = float(values["speed"]), arrays["imu"]
        latitude, longitude = arrays["gnss"][:2].tolist()
        there = self._globe.metres(latitude, longitude)
        self._reckoning = self._reckoning.after(there, imu, speed_mps)
        hero = arrays["hero"].tolist() if "hero" in arrays else None
        pose = self._reckoning.pose if hero is None else (hero[0], hero[1], hero[3])
        self._told.move(pose, None if hero is None else hero[2], speed_mps)
        points = self._scanned(arrays, pose)
        if self._tick % self._every == 0:
            if hero is not None:
                self._told.show(arrays["actors"], arrays["lights"])
            seen = {**self._seen(arrays, speed_mps), **points}
            control, self._memory = self._agent.act(seen, self._memory)
            self._control = [float(value) for value in control]
        return {"control": self._control}

    def _scanned(self, arrays: Arrays, pose: Pose) -> dict[str, NDArray[np.float32]]:
        """The last two halves of the LiDAR, if there is one."""
        if self._lidar is None:
            return {}
        half = thinned(arrays["lidar"], self._lidar)
        before, then = self._half
        self._half = (half, pose)
        return {"lidar": whole_turn(half, before, then, pose) if len(before) else half}

    def _seen(self, arrays: Arrays, speed_mps: float) -> dict[str, Any]:
        """An observation, without the LiDAR."""
        seen: dict[str, Any] = {"speed": np.array([speed_mps], np.float32)}
        told = self._told.observation(self._told_names)
        odometry = told.pop("odometry")
        if "odometry" in self._groups:
            seen["odometry"] = odometry
        if "prompt" in self._groups:
            seen |= told
        if "inertial" in self._groups:
            seen["imu"] = arrays["imu"].astype(np.float32)
            seen["gnss"] = arrays["gnss"].astype(np.float64)
        for camera in self._rig.cameras if self._rig is not None else ():
            seen[camera.name] = np.ascontiguousarray(arrays[camera.name][..., 2::-1])
        return seen

    def close(self) -> None:
        """Closes the agent."""
        self._agent.close()


def serve(spec: str, asked: IO[bytes], answers: IO[bytes]) -> None:
    """Answers until nobody asks any more; whatever goes wrong is told in a line."""
    try:
        seat = Seat(spec)
        write_message(answers, {"ready": True})
        while (message := read_message(asked)) is not None:
            values, arrays = message
            step = seat.start if values.pop("ask") == "start" else seat.tick
            write_message(answers, step(values, arrays))
        seat.close()
    except BrokenPipeError:
        pass  # nobody is there any more
    except Exception as error:
        write_message(answers, {"fault": describe(error)})


def main(spec: str) -> None:
    """The process: asked on its input, it answers on its output, which is nobody else's."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what anybody prints goes where errors go
    serve(spec, sys.stdin.buffer, answers)
