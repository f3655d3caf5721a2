"""A hand-made piece of road, a route and a state on it: small enough to check by arithmetic.

Seen from above (x east, y south). Road 0 runs east: two lanes beside each other (y = 0 and 3.5),
an oncoming one (y = -3.5), parking (y = 6.25, x 20 to 60) and a sidewalk (y = 10). At x = 100 the
junction begins, at x = 120 road 2 goes on. A bridge crosses at x = 50, ten metres up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from di_envs.town.cache import freeze
from di_envs.town.lanes import Crosswalks, LaneKind, Lanes, SignalKind, Signals
from di_envs.town.town import Town
from di_envs.world.dynamics import EgoModel
from di_envs.world.events.watching import begin_events
from di_envs.world.state import ActorKind, Capacity, Routes, State, state_dtype, views_of

CELL_M = 8.0
ROW_COLUMNS = 8


@dataclass(frozen=True, kw_only=True)
class LaneSpec:
    """A straight lane."""

    start: tuple[float, float]
    end: tuple[float, float]
    road: int
    lane_id: int
    kind: LaneKind = LaneKind.DRIVING
    junction: int = -1
    z: float = 0.0
    width: float = 3.5
    successors: tuple[int, ...] = ()
    stop_line: int = -1


EAST, ONCOMING, JUNCTION, EXIT, EAST_RIGHT, PARKING, SIDEWALK, BRIDGE = range(8)
LANES = (
    LaneSpec(start=(0, 0), end=(100, 0), road=0, lane_id=-1, successors=(2,), stop_line=0),
    LaneSpec(start=(100, -3.5), end=(0, -3.5), road=0, lane_id=1),
    LaneSpec(start=(100, 0), end=(120, 0), road=1, lane_id=-1, junction=0, successors=(3,)),
    LaneSpec(start=(120, 0), end=(220, 0), road=2, lane_id=-1),
    LaneSpec(start=(0, 3.5), end=(100, 3.5), road=0, lane_id=-2, stop_line=1),
    LaneSpec(
        start=(20, 6.25), end=(60, 6.25), road=0, lane_id=-3, kind=LaneKind.PARKING, width=2.0
    ),
    LaneSpec(start=(0, 10), end=(100, 10), road=0, lane_id=-4, kind=LaneKind.SIDEWALK, width=2.0),
    LaneSpec(start=(50, -60), end=(50, 60), road=3, lane_id=-1, z=10.0),
)


def make_lanes(specs: tuple[LaneSpec, ...] = LANES) -> Lanes:
    """The lanes as the reader would give them, at half a metre's spacing."""
    rows, widths, owner = [], [], []
    for index, spec in enumerate(specs):
        start, end = np.array(spec.start, float), np.array(spec.end, float)
        count = round(float(np.linalg.norm(end - start)) / 0.5) + 1
        places = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
        yaw = np.arctan2(*(end - start)[::-1])
        rows.append(np.column_stack((places, np.full(count, spec.z), np.full(count, yaw))))
        widths.append(np.full(count, spec.width))
        owner.append(np.full(count, index, np.int32))
    points = np.concatenate(rows)
    counts = np.array([len(row) for row in rows], np.int32)
    lengths = np.array([np.hypot(*np.subtract(spec.end, spec.start)) for spec in specs])
    successors = [spec.successors for spec in specs]
    predecessors = [
        tuple(k for k, other in enumerate(successors) if index in other)
        for index in range(len(specs))
    ]
    known: dict[str, Any] = {
        "kind": np.array([spec.kind for spec in specs], np.int8),
        "road": np.array([spec.road for spec in specs], np.int32),
        "lane_id": np.array([spec.lane_id for spec in specs], np.int32),
        "junction": np.array([spec.junction for spec in specs], np.int32),
        "stop_line": np.array([spec.stop_line for spec in specs], np.int32),
        "length_m": lengths,
        "spacing_m": lengths / (counts - 1),
        "longest_step_m": lengths / (counts - 1),
        "speed_limit_mps": np.full(len(specs), 14.0),
        "first": (np.cumsum(counts) - counts).astype(np.int32),
        "count": counts,
        "points": points,
        "width_m": np.concatenate(widths),
        "point_lane": np.concatenate(owner),
        **_ranges("successor", successors),
        **_ranges("predecessor", predecessors),
        **_index(points),
    }
    return Lanes(**{name: known.get(name, _blank(name, len(specs))) for name in Lanes._fields})


def _blank(name: str, lanes: int) -> np.ndarray:
    """What the kernels under test do not read."""
    if name == "conflict_start":
        return np.zeros(lanes + 1, np.int32)
    if name.startswith("conflict"):
        return np.zeros(0, np.int32 if name == "conflict_lane" else np.float64)
    if name in ("left", "right"):
        return np.full(lanes, -1, np.int32)
    return np.zeros(lanes, np.int8 if name in ("turn", "change") else np.int32)


def _ranges(name: str, links: list[tuple[int, ...]]) -> dict[str, np.ndarray]:
    return {
        f"{name}_start": np.cumsum([0, *map(len, links)]).astype(np.int32),
        name: np.array([k for own in links for k in own], np.int32),
    }


def _index(points: np.ndarray) -> dict[str, np.ndarray]:
    origin = points[:, :2].min(axis=0)
    cell = ((points[:, :2] - origin) / CELL_M).astype(int)
    size = cell.max(axis=0) + 1
    flat = cell[:, 1] * size[0] + cell[:, 0]
    return {
        "grid_origin": origin,
        "grid_size": size.astype(np.int32),
        "cell_m": np.array([CELL_M]),
        "cell_start": np.searchsorted(np.sort(flat), np.arange(size.prod() + 1)).astype(np.int32),
        "cell_point": np.argsort(flat, kind="stable").astype(np.int32),
    }


def make_signals(
    kind: SignalKind = SignalKind.LIGHT, pole: tuple[float, float] = (100.0, 7.0)
) -> Signals:
    """One head at the end of the two eastbound lanes; its box lies before their stop lines."""
    return Signals(
        kind=np.array([kind], np.int8),
        junction=np.zeros(1, np.int32),
        group=np.array([0 if kind == SignalKind.LIGHT else -1], np.int32),
        pose=np.array([[*pole, 0.0, 0.0]]),
        box=np.array([[97.0, 1.75, 0.0, 0.0, 1.5, 3.0]]),
        stop_signal=np.zeros(2, np.int32),
        stop_lane=np.array([EAST, EAST_RIGHT], np.int32),
        stop_pose=np.array([[100.0, 0.0, 0.0, 0.0], [100.0, 3.5, 0.0, 0.0]]),
        stop_width_m=np.full(2, 3.5),
        groups=np.array([2 if kind == SignalKind.LIGHT else 0], np.int32),
    )


def no_crosswalks() -> Crosswalks:
    return Crosswalks(
        start=np.zeros((0, 3)),
        end=np.zeros((0, 3)),
        width_m=np.zeros(0),
        crossed_start=np.zeros(1, np.int32),
        crossed_lane=np.zeros(0, np.int32),
        crossed_begin_m=np.zeros(0),
        crossed_end_m=np.zeros(0),
    )


def make_town(
    lanes: Lanes | None = None,
    signals: Signals | None = None,
    crosswalks: Crosswalks | None = None,
) -> Town:
    """A town of these pieces; frozen as a loaded one is, so that one machine code serves both."""
    town = Town(
        name="piece",
        lanes=lanes if lanes is not None else make_lanes(),
        signals=signals if signals is not None else make_signals(),
        crosswalks=crosswalks if crosswalks is not None else no_crosswalks(),
        road_names=("0", "1", "2", "3"),
        junction_names=("0",),
        geo_origin=(0.0, 0.0),
        content_hash="piece",
        opendrive="",
    )
    return freeze(town)


def make_routes(points: np.ndarray | None = None, timeout_s: float = 1e6) -> Routes:
    """One ego's route: by default a point each metre from x = 0 to 200 along the eastbound lane."""
    if points is None:
        points = np.column_stack((np.arange(201.0), np.zeros((201, 3))))
    steps = np.linalg.norm(np.diff(points[:, :3], axis=0), axis=1)
    targets = np.unique([*range(50, len(points), 50), len(points) - 1])
    return Routes(
        start=np.array([0, len(points)], np.int32),
        points=np.ascontiguousarray(points, float),
        option=np.full(len(points), 4, np.int8),
        lane=np.zeros(len(points), np.int32),
        lane_m=points[:, 0].copy(),
        route_m=np.concatenate(([0.0], np.cumsum(steps))),
        target_start=np.array([0, len(targets)], np.int32),
        target=targets.astype(np.int32),
        timeout_s=np.array([timeout_s]),
    )


def make_state(egos: int = 1, vehicles: int = 0, walkers: int = 0, props: int = 0) -> State:
    """A state with egos at the origin, heading east, and everybody else absent."""
    capacity = Capacity(
        egos=egos, vehicles=vehicles, walkers=walkers, props=props, junctions=1, signals=1
    )
    state = views_of(np.zeros(1, state_dtype(capacity)))
    model = EgoModel()
    for name in ("lane", "path", "previous_lane", "changing_from", "grant", "walk_edge"):
        getattr(state, name)[...] = -1
    for ego in range(egos):
        put(state, ego, ActorKind.CAR, 0.0, 0.0)
        state.half_length[ego] = model.half_length_m
        state.half_width[ego] = model.half_width_m
        state.height[ego] = model.height_m
        begin_events(state, ego)
    return state


def put(
    state: State,
    actor: int,
    kind: ActorKind,
    x: float,
    y: float,
    *,
    yaw: float = 0.0,
    speed: float = 0.0,
    z: float = 0.0,
    half_length: float = 2.4,
    half_width: float = 1.0,
) -> None:
    """Puts an actor somewhere."""
    state.kind[actor] = kind
    state.x[actor], state.y[actor], state.z[actor] = x, y, z
    state.yaw[actor], state.speed[actor] = yaw, speed
    state.half_length[actor], state.half_width[actor] = half_length, half_width


def rows() -> np.ndarray:
    """Empty event rows."""
    return np.zeros((64, ROW_COLUMNS))


def with_lane(specs: tuple[LaneSpec, ...], index: int, **changes: Any) -> tuple[LaneSpec, ...]:
    """The specs with one lane changed."""
    return (*specs[:index], replace(specs[index], **changes), *specs[index + 1 :])
