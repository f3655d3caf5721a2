"""The prompt in CARLA: from where the car is, its route, and what the simulator tells of others.

What our observer does for a world of ours, by the same kernels: they are given a state in which
stand the car and those whom CARLA tells of.
"""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from di_envs.observer import odometry_of, prompt_observation
from di_envs.prompt import COMPONENTS, StopLines, empty_prompt, prompt_route_of, stop_lines_of
from di_envs.prompt_filling import fill_prompt
from di_envs.sensors.carla_sensor import SensorSuiteError
from di_envs.town.lanes import LightState, SignalKind
from di_envs.town.loading import SIDECARS, SYNTHESISE, load_town
from di_envs.town.map_chunks import POINTS, MapChunks, build_map_chunks
from di_envs.town.plan import RoutePlan
from di_envs.town.routing.router import target_indices
from di_envs.town.town import Town
from di_envs.world.building import route_arrays
from di_envs.world.events.progress import advance_progress
from di_envs.world.state import HISTORY_LENGTH, Capacity, State, state_dtype, views_of

MOST_OTHERS = 255
LIGHT_M = 15.0  # from a light's box on our map to the one that CARLA tells of
ACTOR_COLUMNS = ("x", "y", "z", "yaw", "speed", "half_length", "half_width", "kind")


def plan_of_route(points: NDArray[np.float64], option: NDArray[np.int64]) -> RoutePlan:
    """A route that an agent was handed, as a plan, with the target points of Leaderboard 1.0.

    Args:
        points: (R, 4) x, y, z [m], yaw [rad] of the dense route.
        option: (R,) RoadOption.
    """
    steps_m = np.linalg.norm(np.diff(points[:, :3], axis=0), axis=1)
    options = option.astype(np.int8)
    return RoutePlan(
        route_id="",
        town="",
        keypoints=points[[0, -1], :3].copy(),
        points=points.copy(),
        option=options,
        lane=np.full(len(points), -1, np.int32),
        lane_m=np.zeros(len(points)),
        route_m=np.concatenate([[0.0], np.cumsum(steps_m)]),
        targets=target_indices(points, options),
    )


def town_of_text(name: str, opendrive: str) -> Town:
    """CARLA's map as our town, with signals from our sidecar or guessed where the text has none.

    Args:
        name: CARLA's, such as `Carla/Maps/Town05`.
        opendrive: Its text.
    """
    short = name.rpartition("/")[2].lower() or "town"
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*carries no traffic signals")
        path = Path(folder) / f"{short}.xodr"
        path.write_text(opendrive, encoding="utf-8")
        town = load_town(path)
        if len(town.signals.kind) or not town.junction_names:
            return town
        return load_town(path, short if short in SIDECARS else SYNTHESISE)


class Told:
    """What a policy is told along a route. Keeps the state that the kernels read.

    Args:
        plan: The route.
        town: The town; None for a policy that is told of the way and of itself alone.
    """

    def __init__(self, plan: RoutePlan, town: Town | None) -> None:
        signals = 0 if town is None else len(town.signals.kind)
        capacity = Capacity(
            egos=1, vehicles=MOST_OTHERS, walkers=0, props=0, junctions=0, signals=signals
        )
        self._state: State = views_of(np.zeros(1, state_dtype(capacity)))
        self._routes, self._route = route_arrays([plan]), prompt_route_of(plan)
        self._town = town
        self._chunks = _NO_CHUNKS if town is None else build_map_chunks(town.lanes)
        self._lines = _NO_LINES if town is None else stop_lines_of(town.signals)
        self._state.tick[()] = -1

    def move(self, pose: tuple[float, float, float], z: float | None, speed_mps: float) -> None:
        """A tick passes, after which the car is there.

        Args:
            pose: x, y [m], yaw [rad] of its middle.
            z: Its height [m]; None for that of the route where it has come to.
            speed_mps: Its speed.
        """
        state = self._state
        state.tick[()] += 1
        state.kind[0] = 1
        state.x[0], state.y[0], state.yaw[0] = pose
        state.speed[0] = speed_mps
        state.speed_history[0, int(state.tick[()]) % HISTORY_LENGTH] = speed_mps
        if state.tick[()] > 0:  # as in our world, who begins a route has come to no point of it
            advance_progress(state, self._routes, 0)
        state.z[0] = self._route.points[state.route_index[0], 2] if z is None else z

    def show(self, actors: NDArray[np.float64], lights: NDArray[np.float64]) -> None:
        """Who is around, and what lights show.

        Args:
            actors: (N, 8) `ACTOR_COLUMNS`; the kind is an `ActorKind`.
            lights: (L, 3) x, y [m] of the middle of each light's box on the road; `LightState`.

        Raises:
            SensorSuiteError: If there are more actors than can be told.
        """
        if len(actors) > MOST_OTHERS:
            raise SensorSuiteError(f"{len(actors)} actors are told; at most {MOST_OTHERS}")
        state, end = self._state, 1 + len(actors)
        state.kind[1:] = 0
        for column, name in enumerate(ACTOR_COLUMNS):
            getattr(state, name)[1:end] = actors[:, column]
        if self._town is not None:
            state.light[:] = shown_lights(self._town, lights)

    def observation(self, told: tuple[str, ...]) -> dict[str, NDArray[Any]]:
        """The prompt, its flags of presence set for what is told; and odometry."""
        prompt = empty_prompt()
        fill_prompt(self._state, self._route, self._lines, self._chunks, 0, prompt)
        found = prompt_observation(prompt)
        found["command"] = found["command"][0]
        found["prompt_present"] = np.array([name in told for name in COMPONENTS], np.int8)
        found["odometry"] = odometry_of(self._state, self._route, 0)
        return found


def shown_lights(town: Town, lights: NDArray[np.float64]) -> NDArray[np.int8]:
    """(S,) what each signal of a town shows: as the light whose box lies nearest to its own."""
    shown = np.full(len(town.signals.kind), LightState.NONE, np.int8)
    if not len(lights):
        return shown
    away_m = np.hypot(*(town.signals.box[:, None, :2] - lights[None, :, :2]).transpose(2, 0, 1))
    nearest = away_m.argmin(axis=1)
    known = (town.signals.kind == SignalKind.LIGHT) & (away_m.min(axis=1) <= LIGHT_M)
    shown[known] = lights[nearest[known], 2]
    return shown


_NO_LINES = StopLines(np.zeros((0, 4)), np.zeros(0, np.int32), np.zeros(0, np.int8))
_NO_CHUNKS = MapChunks(
    points=np.zeros((0, POINTS, 3)),
    kind=np.zeros((0, POINTS), np.int8),
    centre=np.zeros((0, 2)),
    radius_m=np.zeros(0),
    grid_origin=np.zeros(2),
    grid_size=np.zeros(2, np.int32),
    cell_start=np.zeros(1, np.int32),
    cell_chunk=np.zeros(0, np.int32),
)
