"""Traffic at the start of an episode: who drives, and where, drawn from the seed."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.numerics.arrays import Bool, Float64, Int32
from di_envs.numerics.kernels import kernel
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
# The same for kernels
_SHARE, _LENGTH, _WIDTH, _HEIGHT, _SLOWEST, _FASTEST = range(6)
_MODELS = np.array(
    [(m.share, m.length_m, m.width_m, m.height_m, *m.speed_factor) for m in VEHICLES]
)
_KINDS = np.array([model.kind for model in VEHICLES], np.int8)
_DRIVER_STREAM = int(Stream.TRAFFIC_DRIVER)


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
    chosen = _chosen(spots, plans, int(state.seed[()]))
    if len(chosen) < count:
        warnings.warn(
            f"expected room for {count} vehicles, but the town has {len(chosen)} free places: "
            f"{len(chosen)} drive; ask for no more to hear nothing of it",
            stacklevel=2,
        )
    taken = chosen[:count]
    _set_up(state, lanes, tables, first, spots.lane[taken], spots.station_m[taken])


def _chosen(spots: Spots, plans: tuple[RoutePlan, ...], seed: int) -> NDArray[np.intp]:
    """The places that no ego needs, in an order drawn from the seed."""
    free = np.ones(len(spots.lane), np.bool_)
    for plan in plans:
        near = plan.points[plan.route_m <= ROUTE_CLEARANCE_M, :3]
        x, y, z = np.ascontiguousarray(spots.place.T)
        _keep_free(free, x, y, z, near)
    drawn = keyed_hashes(seed, int(Stream.TRAFFIC_SPAWN), 0, free.size)
    chosen = np.flatnonzero(free)
    return chosen[np.argsort(drawn[chosen], kind="stable")]


@kernel
def _keep_free(free: Bool, x: Float64, y: Float64, z: Float64, route: Float64) -> None:
    """Strikes out places (K,) near the first points (R, 3) of an ego's route."""
    for k in range(route.shape[0]):
        reach = EGO_CLEARANCE_M if k == 0 else 0.5 * SPOT_SPACING_M
        for spot in range(free.size):
            dx, dy, dz = x[spot] - route[k, 0], y[spot] - route[k, 1], z[spot] - route[k, 2]
            free[spot] &= math.sqrt(dx * dx + dy * dy + dz * dz) > reach


@kernel
def _set_up(
    state: State, lanes: Lanes, tables: TrafficTables, first: int, lane: Int32, station_m: Float64
) -> None:
    """Puts a vehicle at each of some places, (C,) lanes and stations, in the slots from `first`."""
    for k in range(lane.size):
        actor = first + k
        _equip(state, actor)
        state.lane[actor] = lane[k]
        state.path[actor, 0] = lane[k]
        state.lane_m[actor] = station_m[k]
        choose_path(state, lanes, tables, actor, 1)
        place_vehicle(state, lanes, actor)


@kernel
def _equip(state: State, actor: int) -> None:
    """Draws what a vehicle is and how fast its driver likes to go."""
    seed, model = int(state.seed[()]), _MODELS.shape[0] - 1
    draw = uniform(seed, _DRIVER_STREAM, 0, actor)
    for candidate in range(_MODELS.shape[0]):
        if draw < _MODELS[candidate, _SHARE]:
            model = candidate
            break
        draw -= _MODELS[candidate, _SHARE]
    state.kind[actor] = _KINDS[model]
    state.half_length[actor] = _MODELS[model, _LENGTH] / 2.0
    state.half_width[actor] = _MODELS[model, _WIDTH] / 2.0
    state.height[actor] = _MODELS[model, _HEIGHT]
    low, high = _MODELS[model, _SLOWEST], _MODELS[model, _FASTEST]
    state.desired_factor[actor] = low + (high - low) * uniform(seed, _DRIVER_STREAM, 1, actor)
