"""Which moments ask for more than to follow the road: those a planner is shown more often.

In drives of an expert they are rare: at one moment in fifty somebody on foot is near the way ahead,
or the ego comes to a red light; at one in a hundred it waits there. How often a moment is drawn
depends on what is there, not on what the expert then does, so what is learnt to follow from it
stays what follows from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
import torch
from numpy.typing import NDArray

from agents.networks.route_frame import OnRoute, in_the_way, on_route
from di_envs.town.lanes import LightState
from di_envs.world.kinds import ActorKind

# By what there is: how much more often a moment is drawn for it; 0 not more often
INTEREST: Mapping[str, float] = MappingProxyType(
    {"people": 8.0, "light": 8.0, "green": 12.0, "sign": 3.0, "crossing": 3.0, "merging": 16.0}
)
_ON_FOOT_OR_TWO_WHEELS = (ActorKind.WALKER, ActorKind.BICYCLE)
_AT_ONCE = 4096  # moments that are looked at together


def draw_weights(rows: NDArray[np.void], interest: Mapping[str, float]) -> NDArray[np.float64]:
    """(M,) how often each moment is drawn beside one at which there is nothing: 1 or more.

    Args:
        rows: (M,) of `caching.MOMENT`.
        interest: As `INTEREST`.
    """
    weights = np.ones(len(rows))
    for first in range(0, len(rows), _AT_ONCE):
        found = reasons(rows[first : first + _AT_ONCE])
        for name, more in interest.items():
            weights[first : first + _AT_ONCE] += more * found[name]
    return weights


def reasons(rows: NDArray[np.void]) -> Mapping[str, NDArray[np.bool_]]:
    """By name of `INTEREST`: (M,) whether there is such a thing near the way ahead.

    `people`: on foot or a bicycle, within 20 m along the way and 6 m beside it. `light`: of the
    ego's lane within 40 m, not green, whether it rolls or waits. `green`: one within 10 m that is.
    `sign`: of its lane within 15 m. `crossing`: a vehicle within 30 m that moves across the way at
    3 m/s or more. `merging`: a vehicle beside the ego, in the lane that its way changes to.
    """
    kind, there = rows["obstacles"][..., 7], rows["obstacles"][..., 8] > 0.0
    people = np.isin(kind, _ON_FOOT_OR_TWO_WHEELS)
    seen = _on_route(rows, "obstacles")
    station_m, aside_m = seen.station_m.numpy(), np.abs(seen.aside_m.numpy())
    beside = (station_m > 0.0) & (station_m < 20.0) & (aside_m < 6.0)
    ahead = (station_m > 0.0) & (station_m < 30.0) & (aside_m < 15.0)
    crosses = ahead & (np.abs(seen.across_mps.numpy()) > 3.0)
    x, y = (np.float32(rows["obstacles"][..., n]) for n in (0, 1))
    beside_ego = (x > -8.0) & (x < 12.0) & (np.abs(y) > 2.2) & (np.abs(y) < 5.0)
    in_its_way = in_the_way(seen, same_way=True).numpy()
    shows, ahead_m = rows["traffic_lights"][..., 3], line_m(rows, "traffic_lights")
    near, at_line = ahead_m < 40.0, ahead_m < 10.0
    return {
        "people": (there & people & beside).any(axis=1),
        "light": (near & (shows >= LightState.YELLOW)).any(axis=1),
        "green": (at_line & (shows == LightState.GREEN)).any(axis=1),
        "sign": (line_m(rows, "stop_signs") < 15.0).any(axis=1),
        "crossing": (there & ~people & crosses).any(axis=1),
        "merging": (there & ~people & beside_ego & in_its_way).any(axis=1),
    }


def line_m(rows: NDArray[np.void], name: str) -> NDArray[np.float32]:
    """(M, K) how far ahead each stop line of the ego's own lane is [m]; infinite for others."""
    seen = _on_route(rows, name)
    own = in_the_way(seen, same_way=True).numpy() & (rows[name][..., -1] > 0.0)
    return np.where(own, seen.station_m.numpy(), np.inf).astype(np.float32)


def _on_route(rows: NDArray[np.void], name: str) -> OnRoute:
    routing, values = (torch.from_numpy(rows[n].astype(np.float32)) for n in ("routing", name))
    velocity = values[..., 5:7] if name == "obstacles" else None
    return on_route(routing, values[..., :3], velocity)
