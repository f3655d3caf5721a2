"""Semantic tags by the version of CARLA that an agent was written for.

Ours are those of CARLA 0.9.14 and later, which Leaderboard 2.x runs. Leaderboard 1.0 runs 0.9.10,
which counts otherwise and calls every vehicle one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from di_envs.sensors.scene.tags import Tag

# of CARLA 0.9.10, by our Tag
_OLD = {
    Tag.NONE: 0,
    Tag.BUILDINGS: 1,
    Tag.FENCES: 2,
    Tag.OTHER: 3,
    Tag.PEDESTRIANS: 4,
    Tag.RIDER: 4,
    Tag.POLES: 5,
    Tag.ROAD_LINES: 6,
    Tag.ROADS: 7,
    Tag.SIDEWALKS: 8,
    Tag.VEGETATION: 9,
    Tag.CAR: 10,
    Tag.TRUCK: 10,
    Tag.BUS: 10,
    Tag.TRAIN: 10,
    Tag.MOTORCYCLE: 10,
    Tag.BICYCLE: 10,
    Tag.WALLS: 11,
    Tag.TRAFFIC_SIGNS: 12,
    Tag.SKY: 13,
    Tag.GROUND: 14,
    Tag.BRIDGE: 15,
    Tag.RAIL_TRACK: 16,
    Tag.GUARD_RAIL: 17,
    Tag.TRAFFIC_LIGHT: 18,
    Tag.STATIC: 19,
    Tag.DYNAMIC: 20,
    Tag.WATER: 21,
    Tag.TERRAIN: 22,
}
_OLD_OF_TAG = np.array([_OLD[tag] for tag in Tag], np.uint8)


def tags_of_version(tags: NDArray[np.uint8], leaderboard: str) -> NDArray[np.uint8]:
    """Our tags as the CARLA of a Leaderboard counts them."""
    return _OLD_OF_TAG[tags] if leaderboard == "1.0" else tags
