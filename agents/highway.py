"""The agent `highway`: highway-env's own driver model and controllers at the wheel of the ego.

At each decision the lanes near the ego and the actors on them become a highway-env road; its
`IDMVehicle` (IDM speed, MOBIL lane changes towards the route's lanes, cascaded steering) decides an
acceleration and a steering angle, and these become pedals and wheel. It knows what highway-env
knows and no more: no traffic lights, no stop signs, no right of way.
Source: Leurent: An environment for autonomous driving decision-making, 2018 (highway-env).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from agents.base import Control, Observation, Requirements, WorldView, make_control
from di_envs.highway.conversion import (
    OFF_ROAD,
    LaneIndex,
    lane_indices,
    to_lane,
    to_obstacle,
    to_vehicle,
)
from di_envs.town.lanes import LaneKind
from di_envs.town.plan import RoutePlan
from di_envs.town.town import Town
from di_envs.world.dynamics import EgoModel, pedals
from di_envs.world.state import ActorKind

if TYPE_CHECKING:
    from highway_env.road.lane import AbstractLane
    from highway_env.road.road import Road, RoadNetwork
    from highway_env.vehicle.behavior import IDMVehicle

LOOK_M = 80.0  # how far away actors are taken over
LEVEL_M = 5.0  # whoever is further above or below is on another level; roads climb
LEGS_AHEAD = 3


@dataclass(frozen=True, kw_only=True)
class HighwayMemory:
    """The route as highway-env edges, the lane wanted on each, and what `IDMVehicle` keeps."""

    plan: RoutePlan
    legs: tuple[LaneIndex, ...] = ()
    leg: int = 0  # the target lane's place in `legs`
    target: LaneIndex | None = None
    timer_s: float = 0.0  # since MOBIL was last asked


class HighwayAgent:
    """Drives by highway-env's `IDMVehicle`.

    Args:
        model: The ego's dynamics, to turn an acceleration and a curvature into controls.
    """

    requires = Requirements(observations=("prompt",), control_dt_s=0.1, privileged=True)

    def __init__(self, *, model: EgoModel | None = None) -> None:
        self._model = (model or EgoModel()).parameters()
        self._towns: dict[str, _HighwayTown] = {}  # only saves time: made anew, it is the same

    def start(self, plan: RoutePlan, seed: int) -> HighwayMemory:
        """Remembers the plan; it is put into edges once the town is seen."""
        return HighwayMemory(plan=plan)

    def act(self, observation: Observation, memory: HighwayMemory) -> tuple[Control, HighwayMemory]:
        """One decision of highway-env's driver."""
        view: WorldView = observation["world"]
        town = self._town(view.town)
        if memory.target is None:
            legs = town.legs(memory.plan)
            target = town.names[int(memory.plan.lane[0])]
            memory = HighwayMemory(plan=memory.plan, legs=legs, target=target)
        road = town.road_near(view, memory)
        driver = self._driver(view, road, memory)
        driver.act()
        throttle, brake = pedals(
            float(driver.action["acceleration"]), float(driver.speed), self._model
        )
        control = make_control(throttle, self._wheel(float(driver.action["steering"])), brake)
        return control, self._remember(driver, memory)

    def close(self) -> None:
        """Forgets the towns."""
        self._towns.clear()

    def _town(self, town: Town) -> _HighwayTown:
        if town.content_hash not in self._towns:
            self._towns[town.content_hash] = _HighwayTown(town)
        return self._towns[town.content_hash]

    def _driver(self, view: WorldView, road: Road, memory: HighwayMemory) -> IDMVehicle:
        state, ego = view.state, view.ego
        position = np.array([float(state.x[ego]), float(state.y[ego])])
        here = road.network.get_closest_lane_index(position, float(state.yaw[ego]))
        driver = to_vehicle(view, ego, road, here)
        driver.target_lane_index = memory.target
        driver.timer = memory.timer_s
        driver.route = list(memory.legs[memory.leg : memory.leg + LEGS_AHEAD])
        road.vehicles.insert(0, driver)
        return driver

    def _remember(self, driver: IDMVehicle, memory: HighwayMemory) -> HighwayMemory:
        target = tuple(driver.target_lane_index)
        leg = memory.leg
        if memory.target is not None and target[:2] != memory.target[:2]:
            leg = min(leg + 1, len(memory.legs) - 1)
        return HighwayMemory(
            plan=memory.plan,
            legs=memory.legs,
            leg=leg,
            target=(str(target[0]), str(target[1]), int(target[2])),
            timer_s=driver.timer + self.requires.control_dt_s,
        )

    def _wheel(self, steering_rad: float) -> float:
        """Wheel position with the curvature that the angle has in highway-env's bicycle."""
        from highway_env.vehicle.kinematics import Vehicle

        curvature = math.sin(math.atan(0.5 * math.tan(steering_rad))) / (0.5 * Vehicle.LENGTH)
        model = self._model
        slip = math.asin(min(max(curvature * model.rear_axle_m, -0.99), 0.99))
        wheelbase = model.front_axle_m + model.rear_axle_m
        return math.atan(math.tan(slip) * wheelbase / model.rear_axle_m) / model.steer_gain_rad


class _HighwayTown:
    """A town's lanes as highway-env lanes, and roads made of those near the ego."""

    def __init__(self, town: Town) -> None:
        self.names = lane_indices(town)
        self.edges: dict[tuple[str, str], list[AbstractLane]] = {}
        self.leaving: dict[str, list[str]] = {}
        for lane, name in self.names.items():
            self.edges.setdefault(name[:2], []).append(to_lane(town.lanes, lane))
        for start, end in self.edges:
            self.leaving.setdefault(start, []).append(end)
        self.entering: dict[str, list[str]] = {}
        for start, end in self.edges:
            self.entering.setdefault(end, []).append(start)
        self._lanes = town.lanes

    def legs(self, plan: RoutePlan) -> tuple[LaneIndex, ...]:
        """The route's edges in order; on each, the lane that the route leaves it by."""
        legs: list[LaneIndex] = []
        for lane in plan.lane.tolist():
            name = self.names[lane]
            if legs and legs[-1][:2] == name[:2]:
                legs[-1] = name
            elif len(legs) > 1 and legs[-2][:2] == name[:2]:
                legs.pop()  # the route steps back where keypoints join
                legs[-1] = name
            else:
                legs.append(name)
        last = plan.lane.tolist()[-1]
        for _ in range(LEGS_AHEAD):  # go on behind the end, as there is nothing to stop for
            after = self._lanes.successor[
                self._lanes.successor_start[last] : self._lanes.successor_start[last + 1]
            ]
            if not len(after):
                break
            last = int(after[0])
            if self._lanes.kind[last] == LaneKind.DRIVING:
                legs.append(self.names[last])
        return tuple(legs)

    def road_near(self, view: WorldView, memory: HighwayMemory) -> Road:
        """The edges of the next legs, those that touch them, and whoever is near on them."""
        from highway_env.road.road import Road

        network = self._network(memory)
        road = Road(
            network,
            np_random=np.random.RandomState(0),
            neighbour_vehicles_connected_lanes=True,
        )
        state, ego = view.state, view.ego
        for actor in range(state.kind.size):
            kind = state.kind[actor]
            if actor == ego or kind in OFF_ROAD or not _is_near(state, actor, ego):
                continue
            if kind == ActorKind.WALKER:
                road.objects.append(to_obstacle(view, actor))
                continue
            name = self.names.get(int(state.lane[actor]))
            if name is not None and name[:2] in self.edges:
                graph = network.graph.setdefault(name[0], {})
                graph.setdefault(name[1], self.edges[name[:2]])
                road.vehicles.append(to_vehicle(view, actor, road, name))
        return road

    def _network(self, memory: HighwayMemory) -> RoadNetwork:
        from highway_env.road.road import RoadNetwork

        network = RoadNetwork()
        begin = max(memory.leg - 1, 0)
        wanted: list[tuple[str, str]] = []
        for leg in memory.legs[begin : memory.leg + LEGS_AHEAD]:
            wanted += [leg[:2]]
            wanted += [(leg[0], end) for end in self.leaving.get(leg[0], [])]
        if memory.target is not None:
            wanted.append(memory.target[:2])
        for start, end in wanted:
            network.graph.setdefault(start, {})[end] = self.edges[(start, end)]
        return network


def _is_near(state: Any, actor: int, ego: int) -> bool:
    dx, dy = state.x[actor] - state.x[ego], state.y[actor] - state.y[ego]
    level = abs(state.z[actor] - state.z[ego]) < LEVEL_M
    return bool(level and dx * dx + dy * dy < LOOK_M * LOOK_M)
