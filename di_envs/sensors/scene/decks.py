"""Elevated roads as boxes: decks on pillars, embankments where they are low, rails along both."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from di_envs.sensors.scene.boxes import BoxSpec, Material
from di_envs.sensors.scene.free_ground import FreeGround
from di_envs.sensors.scene.surfaces import ELEVATED_M
from di_envs.sensors.scene.tags import Tag
from di_envs.town.lanes import Lanes
from di_envs.town.town import Town

SLAB_M = 10.0  # length of a deck's pieces
SHORT_SLAB_M = 2.0  # what is bent is cut shorter, down to this …
STEP_M = 0.012  # … as long as a flat piece is so far from its lanes: the steps between would show
DECK_THICKNESS_M = 1.3
EMBANKMENT_M = 4.0  # decks lower than this stand on earth
PILLAR_EVERY_M = 24.0

_CONCRETE = (0.52, 0.51, 0.49)
_STEEL = (0.62, 0.63, 0.65)


class Slab(NamedTuple):
    """A piece of an elevated road: a rectangle, turned by its yaw, that rises by its pitch."""

    x: float  # of the middle of its surface [m]
    y: float
    z: float
    yaw: float
    pitch: float
    half_length: float  # over ground [m]
    half_width: float
    reach: float  # of a circle round it [m]


def slabs_of(town: Town, base_z: float) -> Iterator[Slab]:
    """The elevated roads of a town, whose plane lies at height `base_z` [m], in pieces."""
    lanes = town.lanes
    lane = lanes.point_lane
    index = np.flatnonzero(lanes.points[:, 2] - base_z > ELEVATED_M)
    # point_lane follows the order of points
    keys = lanes.road[lane[index]].astype(np.int64) * 100000 + np.floor(
        lanes.road_m[index] / SLAB_M
    ).astype(np.int64)
    order = np.argsort(keys, kind="stable")
    index, keys = index[order], keys[order]
    cuts = np.flatnonzero(np.diff(keys)) + 1
    for rows in _flat_pieces(lanes, np.split(index, cuts)):
        points, half_width = lanes.points[rows], lanes.width_m[rows] / 2.0
        twice = np.exp(2j * points[:, 3]).mean()  # lanes of both directions lie on one axis
        yaw = float(np.angle(twice)) / 2.0
        c, s = math.cos(yaw), math.sin(yaw)
        along = c * points[:, 0] + s * points[:, 1]
        across = c * points[:, 1] - s * points[:, 0]
        u0, u1 = along.min() - 0.4, along.max() + 0.4
        v0, v1 = (across - half_width).min(), (across + half_width).max()
        middle_u, middle_v = (u0 + u1) / 2.0, (v0 + v1) / 2.0
        if np.ptp(along) > 0.5:
            slope, level = np.polyfit(along - middle_u, points[:, 2], 1).tolist()
        else:
            slope, level = 0.0, float(points[:, 2].mean())
        yield Slab(
            x=c * middle_u - s * middle_v,
            y=s * middle_u + c * middle_v,
            z=level,
            yaw=yaw,
            pitch=math.atan(slope),
            half_length=(u1 - u0) / 2.0,
            half_width=(v1 - v0) / 2.0,
            reach=math.hypot(u1 - u0, v1 - v0) / 2.0,
        )


def _flat_pieces(lanes: Lanes, pieces: list[NDArray[Any]]) -> Iterator[NDArray[Any]]:
    """Rows of points of each piece of an elevated road, cut in two as long as it is bent."""
    for rows in pieces:
        if rows.size < 2:
            continue
        station, z = lanes.road_m[rows], lanes.points[rows, 2]
        long = float(np.ptp(station))
        if long > 2.0 * SHORT_SLAB_M:
            flat = np.polyval(np.polyfit(station, z, 1), station)
            if np.abs(z - flat).max() > STEP_M:
                first = station < station.min() + long / 2.0
                yield from _flat_pieces(lanes, [rows[first], rows[~first]])
                continue
        yield rows


def decks_of(slabs: list[Slab], base_z: float, free: FreeGround) -> Iterator[BoxSpec]:
    """Decks or embankments, with rails along both sides and pillars below where there is room."""
    every = max(1, round(PILLAR_EVERY_M / SLAB_M))
    for number, slab in enumerate(slabs):
        above = slab.z - base_z
        yield _deck(slab, DECK_THICKNESS_M if above >= EMBANKMENT_M else above + 0.5)
        for side in (-1.0, 1.0):
            if above > 1.0:
                yield _rail(slab, side)
            if above > EMBANKMENT_M and number % every == 0:
                far = side * slab.half_width * 0.55
                x, y = slab.x - math.sin(slab.yaw) * far, slab.y + math.cos(slab.yaw) * far
                if free.is_free(x, y, 1.3, 1.3):
                    yield _pillar(x, y, base_z, above - DECK_THICKNESS_M, slab.yaw)


def _deck(slab: Slab, thick: float) -> BoxSpec:
    c, s = math.cos(slab.yaw), math.sin(slab.yaw)
    return BoxSpec(
        centre=(
            slab.x + c * math.sin(slab.pitch) * thick / 2.0,
            slab.y + s * math.sin(slab.pitch) * thick / 2.0,
            slab.z - math.cos(slab.pitch) * thick / 2.0,
        ),
        half=(slab.half_length / math.cos(slab.pitch), slab.half_width, thick / 2.0),
        yaw=slab.yaw,
        pitch=slab.pitch,
        colour=_CONCRETE,
        tag=Tag.BRIDGE,
        material=Material.DECK,
    )


def _rail(slab: Slab, side: float) -> BoxSpec:
    """The rail on the right (1) or the left (-1)."""
    c, s = math.cos(slab.yaw), math.sin(slab.yaw)
    out = side * (slab.half_width - 0.12)
    return BoxSpec(
        centre=(slab.x - s * out, slab.y + c * out, slab.z + 0.4),
        half=(slab.half_length / math.cos(slab.pitch), 0.12, 0.4),
        yaw=slab.yaw,
        pitch=slab.pitch,
        colour=_STEEL,
        tag=Tag.GUARD_RAIL,
    )


def _pillar(x: float, y: float, base_z: float, high: float, yaw: float) -> BoxSpec:
    return BoxSpec(
        centre=(x, y, base_z + high / 2.0),
        half=(0.7, 0.9, high / 2.0),
        yaw=yaw,
        colour=_CONCRETE,
        tag=Tag.BRIDGE,
    )
