"""Traffic at the start of an episode: who drives, and where, drawn from the seed."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.keyed_arrays import keyed_hashes
from di_envs.numerics.keyed_random import Stream, uniform
from di_envs.town.lanes import Lanes
from di_envs.town.plan import RoutePlan
from di_envs.world.state import ActorKind, State
from di_envs.world.traffic.motion import choose_path, place_vehicle
from di_envs.world.traffic.tables import TrafficTables

SPOT_SPACING_M = 12.0  # more than the longest vehicle with a gap
END_MARGIN_M = 8.0  # free at both ends of a lane
FULL_SHARE = 0.75  # of its greatest width, which a lane has where somebody may stand on it
EGO_CLEARANCE_M = 15.0  # free around an ego's start, on all lanes
ROUTE_CLEARANCE_M = 30.0  # free of vehicles at the beginning of an ego's route


@dataclass(frozen=True, kw_only=True)
class VehicleModel:
    """A sort of vehicle: its box, how common it is, and how fast it goes."""

    kind: ActorKind
    share: float  # of all vehicles
    length_m: float
    width_m: float
    height_m: float
    speed_factor: tuple[float, float]  # of the speed limit, lowest and highest driver


VEHICLES = (
    VehicleModel(
        kind=ActorKind.CAR,
        share=0.70,
        length_m=4.6,
        width_m=1.9,
        height_m=1.5,
        speed_factor=(0.85, 1.1),
    ),
    VehicleModel(
        kind=ActorKind.VAN,
        share=0.10,
        length_m=5.6,
        width_m=2.0,
        height_m=2.3,
        speed_factor=(0.85, 1.05),
    ),
    VehicleModel(
        kind=ActorKind.TRUCK,
        share=0.05,
        length_m=7.0,
        width_m=2.4,
        height_m=3.0,
        speed_factor=(0.75, 0.95),
    ),
    VehicleModel(
        kind=ActorKind.BUS,
        share=0.04,
        length_m=8.6,
        width_m=2.4,
        height_m=3.1,
        speed_factor=(0.75, 0.95),
    ),
    VehicleModel(
        kind=ActorKind.MOTORCYCLE,
        share=0.07,
        length_m=2.2,
        width_m=0.8,
        height_m=1.5,
        speed_factor=(0.9, 1.1),
    ),
    VehicleModel(
        kind=ActorKind.BICYCLE,
        share=0.04,
        length_m=1.8,
        width_m=0.6,
        height_m=1.7,
        speed_factor=(0.4, 0.5),
    ),
)


class Spots(NamedTuple):
    """Places of a town, K of them, where vehicles may stand at first."""

    lane: NDArray[np.int32]  # (K,)
    station_m: NDArray[np.float64]  # (K,)
    place: NDArray[np.float64]  # (K, 3) x, y, z


def find_spots(lanes: Lanes, tables: TrafficTables) -> Spots:
    """Places on lanes outside junctions, a vehicle's length and a gap apart.

    None where a lane only begins: there it lies over the lane beside it.
    """
    lane_of, station_m, point = [np.zeros(0, np.int32)], [np.zeros(0)], [np.zeros(0, np.int32)]
    for lane in np.flatnonzero((tables.usable == 1) & (lanes.junction < 0)):
        stations = np.arange(END_MARGIN_M, lanes.length_m[lane] - END_MARGIN_M, SPOT_SPACING_M)
        full = FULL_SHARE * lanes.width_m[lanes.first[lane] :][: lanes.count[lane]].max()
        points = lanes.first[lane] + (stations / lanes.spacing_m[lane]).astype(np.int32)
        wide = lanes.width_m[points] >= full
        lane_of.append(np.full(wide.sum(), lane, np.int32))
        station_m.append(stations[wide])
        point.append(points[wide])
    place = np.ascontiguousarray(lanes.points[np.concatenate(point), :3])
    return Spots(np.concatenate(lane_of), np.concatenate(station_m), place)


def spawn_traffic(
    state: State,
    lanes: Lanes,
    tables: TrafficTables,
    spots: Spots,
    plans: tuple[RoutePlan, ...],
    first: int,
    count: int,
) -> None:
    """Places up to `count` vehicles in the slots from `first` on, at rest, none on an ego's path.

    Where the town has fewer free places, as many drive as fit, and a warning says so.
    """
    seed = int(state.seed[()])
    chosen = _chosen(spots, plans, seed)
    if len(chosen) < count:
        warnings.warn(
            f"expected room for {count} vehicles, but the town has {len(chosen)} free places: "
            f"{len(chosen)} drive; ask for no more to hear nothing of it",
            stacklevel=2,
        )
    for actor, spot in enumerate(chosen[:count].tolist(), first):
        _equip(state, actor, seed)
        state.lane[actor] = state.path[actor, 0] = spots.lane[spot]
        state.lane_m[actor] = spots.station_m[spot]
        choose_path(state, lanes, tables, actor, 1)
        place_vehicle(state, lanes, actor)


def _chosen(spots: Spots, plans: tuple[RoutePlan, ...], seed: int) -> NDArray[np.intp]:
    """The places that no ego needs, in an order drawn from the seed."""
    free = np.ones(len(spots.lane), bool)
    for plan in plans:
        near = plan.points[plan.route_m <= ROUTE_CLEARANCE_M, :3]
        for k, point in enumerate(near):
            reach = EGO_CLEARANCE_M if k == 0 else 0.5 * SPOT_SPACING_M
            free &= np.linalg.norm(spots.place - point, axis=1) > reach
    drawn = keyed_hashes(seed, int(Stream.TRAFFIC_SPAWN), 0, free.size)
    chosen = np.flatnonzero(free)
    return chosen[np.argsort(drawn[chosen], kind="stable")]


def _equip(state: State, actor: int, seed: int) -> None:
    """Draws what a vehicle is and how fast its driver likes to go."""
    stream = int(Stream.TRAFFIC_DRIVER)
    draw, model = uniform(seed, stream, 0, actor), VEHICLES[-1]
    for candidate in VEHICLES:
        if draw < candidate.share:
            model = candidate
            break
        draw -= candidate.share
    low, high = model.speed_factor
    state.kind[actor] = model.kind
    state.half_length[actor] = model.length_m / 2.0
    state.half_width[actor] = model.width_m / 2.0
    state.height[actor] = model.height_m
    state.desired_factor[actor] = low + (high - low) * uniform(seed, stream, 1, actor)
