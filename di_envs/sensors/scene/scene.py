"""The scene: what stands where, for cameras and LiDAR alike, so that they never disagree.

`scene_of(town)` builds what never moves: rasters of the ground, and static boxes with a grid that
finds those nearby. `collect_boxes` then puts together what there is round an ego at this moment.
Sensors intersect their rays with the plane `base_z` and with these boxes, and with nothing else.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Float64
from di_envs.numerics.bundles import by_reference
from di_envs.numerics.kernels import kernel
from di_envs.sensors.scene.actor_boxes import DETAIL_M, add_actor
from di_envs.sensors.scene.actor_parts import PARTS, Parts
from di_envs.sensors.scene.boxes import Boxes, Material, boxes_of, copy_box, empty_boxes, turn_box
from di_envs.sensors.scene.props import scenery_of
from di_envs.sensors.scene.raster import Raster
from di_envs.sensors.scene.signal_heads import LAMP_DEPTH_M, LAMP_HALF_M, Lamps, signal_boxes
from di_envs.sensors.scene.surfaces import build_rasters
from di_envs.sensors.scene.tags import Tag
from di_envs.town.once import once_a_town
from di_envs.town.town import Town
from di_envs.world.state import State

LONGEST_M = 6.0  # from an actor's middle to what sticks out farthest
ROOM = 4096  # boxes that a sensor can see at once
_LAMP_COLOURS = np.array(
    [(0.0, 0.0, 0.0), (0.10, 1.0, 0.30), (1.0, 0.78, 0.05), (1.0, 0.06, 0.05)], np.float32
)  # by LightState
_DARK = 0.16  # of a lamp's colour when it is not lit
_LIGHT_TAG = int(Tag.TRAFFIC_LIGHT)
_LAMP, _PLAIN = int(Material.LAMP), int(Material.PLAIN)


@by_reference
class Scene(NamedTuple):
    """What is static in a town."""

    base_z: Float64  # (1,) height of the ground plane [m]
    ground: Raster  # of the plane
    deck: Raster  # of the tops of boxes of Material.DECK
    boxes: Boxes
    reach_m: Float64  # (B,) of a ball round each box
    lamps: Lamps
    parts: Parts  # what actors are made of


@once_a_town
def scene_of(town: Town) -> Scene:
    """The scene of a town, about 2 s for Town05."""
    return build_scene(town)


def build_scene(town: Town) -> Scene:
    """Paints the ground and places the scenery. Its arrays are read-only."""
    base_z = float(np.median(town.lanes.points[:, 2]))
    ground, deck, classes = build_rasters(town, base_z)
    signs, lamps = signal_boxes(town, classes, ground.origin)
    boxes = boxes_of([*scenery_of(town, base_z, classes, ground.origin), *signs])
    scene = Scene(
        base_z=np.array([base_z]),
        ground=ground,
        deck=deck,
        boxes=boxes,
        reach_m=np.linalg.norm(boxes.half.astype(np.float64), axis=1),
        lamps=lamps,
        parts=PARTS,
    )
    for bundle in (scene, ground, deck, boxes, lamps, PARTS):
        for array in bundle:
            if isinstance(array, np.ndarray):
                array.flags.writeable = False
    return scene


def box_buffer() -> Boxes:
    """Room for what `collect_boxes` finds."""
    return empty_boxes(ROOM)


@kernel
def collect_boxes(scene: Scene, state: State, ego: int, range_m: float, out: Boxes) -> None:
    """Puts together all boxes within range of an ego, but for the ego's own.

    Actors come first, then lamps, then what is static; within each, by index.

    Args:
        scene: Of the town.
        state: Of the world.
        ego: Index of the ego that looks.
        range_m: How far it sees [m].
        out: Boxes to overwrite.
    """
    out.count[0] = 0
    x, y = state.x[ego], state.y[ego]
    for actor in range(state.kind.shape[0]):
        if actor == ego or state.kind[actor] == 0:
            continue
        dx, dy = state.x[actor] - x, state.y[actor] - y
        far2 = dx * dx + dy * dy
        if far2 < (range_m + LONGEST_M) * (range_m + LONGEST_M):
            detailed = far2 < DETAIL_M * DETAIL_M
            add_actor(state, actor, detailed, scene.parts, out)
    _add_lamps(scene.lamps, state, x, y, range_m, out)
    boxes = scene.boxes
    for row in range(boxes.count[0]):
        dx, dy = boxes.centre[row, 0] - x, boxes.centre[row, 1] - y
        reach = range_m + scene.reach_m[row]
        if dx * dx + dy * dy < reach * reach:
            copy_box(boxes, row, out)


@kernel
def _add_lamps(lamps: Lamps, state: State, x: float, y: float, range_m: float, out: Boxes) -> None:
    """Appends the lamps of traffic lights within range of a place [m], lit or dark."""
    for lamp in range(lamps.signal.shape[0]):
        dx, dy = lamps.pose[lamp, 0] - x, lamps.pose[lamp, 1] - y
        at = out.count[0]
        if dx * dx + dy * dy > range_m * range_m or at >= out.yaw.shape[0]:
            continue
        lit = state.light[lamps.signal[lamp]] == lamps.state[lamp]
        for axis in range(3):
            out.centre[at, axis] = lamps.pose[lamp, axis]
            share = 1.0 if lit else _DARK
            out.colour[at, axis] = share * _LAMP_COLOURS[lamps.state[lamp], axis]
        out.half[at, 0] = LAMP_DEPTH_M
        out.half[at, 1] = LAMP_HALF_M
        out.half[at, 2] = LAMP_HALF_M
        turn_box(out, at, lamps.pose[lamp, 3])
        out.pitch[at] = 0.0
        out.tag[at] = _LIGHT_TAG
        out.material[at] = _LAMP if lit else _PLAIN
        out.instance[at] = 0
        out.count[0] = at + 1
