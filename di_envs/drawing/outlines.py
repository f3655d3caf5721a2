"""What a picture of a world from above is made of: outlines in metres and colours.

Used by whatever draws: the environments' renderer and the documentation's pictures.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from di_envs.town.lanes import Crosswalks, LaneKind, Lanes, LightState, SignalKind, Signals
from di_envs.world.kinds import ActorKind
from di_envs.world.world import WorldView

Array = NDArray[np.float64]

LAND, PAPER = "#e9ece4", "#ffffff"
SURFACE = {
    LaneKind.SIDEWALK: "#cdcdc5",
    LaneKind.SHOULDER: "#83888f",
    LaneKind.PARKING: "#777c84",
    LaneKind.DRIVING: "#5c626b",
}  # in the order in which they are laid over each other
ROUTE, EGO, TARGET = "#3b8eff", "#ff5a36", "#ffffff"
LIGHT = {LightState.GREEN: "#2bd46a", LightState.YELLOW: "#ffc928", LightState.RED: "#ff3b3b"}
ACTOR = {
    ActorKind.CAR: "#f4f1e8",
    ActorKind.VAN: "#bfe3ff",
    ActorKind.TRUCK: "#ffdb99",
    ActorKind.BUS: "#ffb36b",
    ActorKind.MOTORCYCLE: "#e3b7ff",
    ActorKind.BICYCLE: "#b6f2c4",
    ActorKind.WALKER: "#ffe14d",
    ActorKind.DEBRIS: "#9a7b55",
    ActorKind.VENDING_MACHINE: "#b64a4a",
}  # all but poles
EDGE = "#30343a"  # of actors
BRIDGE_M = 3.0  # what is higher is drawn over the streets below
_ABOUT = np.array([0.0, 0.0, 0.0, np.pi])  # turns a pose to face backwards
PIECE = 40  # points of a lane that are drawn as one polygon


def strip(points: Array, width_m: Array) -> Array:
    """The outline (2N, 2) of a lane's surface from its centre points (N, 4) and widths (N,)."""
    right = np.stack([-np.sin(points[:, 3]), np.cos(points[:, 3])], axis=1)
    reach = right * (0.5 * width_m + 0.05)[:, None]  # a little over, so that no seam shows
    return np.concatenate([points[:, :2] + reach, (points[:, :2] - reach)[::-1]])


def surfaces(lanes: Lanes, kind: LaneKind, above: bool, bridge_m: float = BRIDGE_M) -> list[Array]:
    """Outlines of all lanes of a kind, above or below the level of bridges."""
    outlines = []
    for lane in np.flatnonzero(lanes.kind == kind):
        first, end = lanes.first[lane], lanes.first[lane] + lanes.count[lane]
        for begin in range(first, end - 1, PIECE):
            rows = slice(begin, min(begin + PIECE + 1, end))
            if (lanes.points[rows, 2].mean() > bridge_m) == above:
                outlines.append(strip(lanes.points[rows], lanes.width_m[rows]))
    return outlines + (junction_floors(lanes, above) if kind == LaneKind.DRIVING else [])


def junction_floors(lanes: Lanes, above: bool) -> list[Array]:
    """What is road between the lanes of junctions, where no lane lies: outlines (4, 2).

    Each lane that leads into or out of a junction goes straight on in it, as wide as it is, to the
    furthest of the junction's lanes that it meets.
    """
    inside = (lanes.kind == LaneKind.DRIVING) & (lanes.junction >= 0)
    by_junction = {
        int(junction): np.flatnonzero(inside & (lanes.junction == junction))
        for junction in np.unique(lanes.junction[inside])
    }
    floors = []
    for ways in by_junction.values():
        rows = np.concatenate([lanes.first[way] + np.arange(lanes.count[way]) for way in ways])
        points, widths = lanes.points[rows], lanes.width_m[rows]
        if (points[:, 2].mean() > BRIDGE_M) != above:
            continue
        first = lanes.first[ways]
        mouths = [*lanes.points[first], *(lanes.points[first + lanes.count[ways] - 1] + _ABOUT)]
        sizes = [*lanes.width_m[first], *lanes.width_m[first + lanes.count[ways] - 1]]
        for (x, y, _, yaw), width in zip(mouths, sizes, strict=True):
            c, s = np.cos(yaw), np.sin(yaw)
            ahead = c * (points[:, 0] - x) + s * (points[:, 1] - y)
            right = c * (points[:, 1] - y) - s * (points[:, 0] - x)
            reach = ahead + 0.5 * widths * np.abs(np.sin(points[:, 3] - yaw))
            depth = reach[(np.abs(right) < 0.5 * width) & (ahead > -0.5)].max()
            ends = np.array([[x, y, 0.0, yaw], [x + c * depth, y + s * depth, 0.0, yaw]])
            floors.append(strip(ends, np.full(2, width)))
    return floors


def crosswalk_bars(walks: Crosswalks) -> list[Array]:
    """Outlines (4, 2) of the bars across the road, 0.5 m wide at 1 m."""
    bars = []
    for start, end, width in zip(walks.start, walks.end, walks.width_m, strict=True):
        along = (end - start)[:2]
        length = float(np.hypot(*along))
        along, across = along / length, np.array([-along[1], along[0]]) / length * width / 2
        for station in np.arange(0.25, length - 0.5, 1.0):
            a, b = start[:2] + along * station, start[:2] + along * (station + 0.5)
            bars.append(np.array([a - across, b - across, b + across, a + across]))
    return bars


def stop_line_ends(signals: Signals) -> Array:
    """Both ends (K, 2, 2) of each stop line."""
    yaw = signals.stop_pose[:, 3]
    across = np.stack([-np.sin(yaw), np.cos(yaw)], axis=1) * 0.45 * signals.stop_width_m[:, None]
    middle = signals.stop_pose[:, :2]
    return np.stack([middle - across, middle + across], axis=1)


def stop_line_colours(view: WorldView) -> list[str]:
    """The colour that the light of each stop line shows (K,); white for signs."""
    signals = view.town.signals
    lights = view.state.light[signals.stop_signal].tolist()
    is_light = signals.kind[signals.stop_signal] == SignalKind.LIGHT
    return [
        LIGHT[LightState(light)] if shows else "#ffffff"
        for light, shows in zip(lights, is_light.tolist(), strict=True)
    ]


def box(x: float, y: float, yaw: float, half_length: float, half_width: float) -> Array:
    """Outline (5, 2) of a vehicle, with a pointed front that shows where it is heading."""
    nose = 0.8 * half_length
    local = np.array([[-1, -1], [-1, 1], [0, 1], [0, 0], [0, -1]], float) * (
        half_length,
        half_width,
    )
    local[2:, 0] = nose, half_length, nose
    c, s = np.cos(yaw), np.sin(yaw)
    return np.stack(
        [x + c * local[:, 0] - s * local[:, 1], y + s * local[:, 0] + c * local[:, 1]], 1
    )
