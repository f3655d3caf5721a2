"""What actors look like: each kind of vehicle, walker and prop as a handful of boxes.

A part's place and size are shares of the actor's own box (half length, half width, height), so one
table serves every size. Far from the ego the small parts are left out.
"""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import keyed_hash
from di_envs.sensors.scene.boxes import Material
from di_envs.sensors.scene.tags import Tag
from di_envs.world.kinds import ActorKind

DETAIL_M = 60.0  # beyond which only the large parts are drawn
_VEHICLE_COLOUR = 13  # Stream.VEHICLE_COLOUR, as a plain number for kernels
_PLAIN, _LAMP, _WINDOWS = int(Material.PLAIN), int(Material.LAMP), int(Material.WINDOWS)
_PROP = int(ActorKind.PROP)

# What a part is: BODY takes the actor's own colour
BODY, GLASS, TYRE, TAIL, LEFT, RIGHT, HEAD, TRIM, TROUSERS, SKIN = range(10)
EARTH, RUBBLE, CABINET, DISPLAY = range(10, 14)

# Colours of cars, drawn by key: whites, greys and blacks mostly, as on real streets
_BODIES = np.array(
    [
        (0.85, 0.85, 0.85),
        (0.70, 0.71, 0.73),
        (0.42, 0.43, 0.45),
        (0.13, 0.13, 0.14),
        (0.55, 0.09, 0.08),
        (0.14, 0.24, 0.52),
        (0.16, 0.33, 0.24),
        (0.66, 0.56, 0.36),
    ],
    np.float32,
)
_FIXED = np.array(
    [
        (0.0, 0.0, 0.0),
        (0.10, 0.13, 0.16),  # glass
        (0.05, 0.05, 0.05),  # tyre
        (0.38, 0.03, 0.03),  # tail light, unlit
        (0.45, 0.25, 0.05),  # indicators, unlit
        (0.45, 0.25, 0.05),
        (0.75, 0.75, 0.72),  # headlight
        (0.20, 0.20, 0.21),  # trim
        (0.16, 0.17, 0.24),  # trousers
        (0.72, 0.53, 0.42),  # skin
        (0.30, 0.23, 0.16),  # earth
        (0.47, 0.43, 0.37),  # rubble
        (0.62, 0.07, 0.08),  # cabinet
        (0.58, 0.66, 0.70),  # display
    ],
    np.float32,
)
_BRAKE_LIT = np.array((1.0, 0.10, 0.06), np.float32)
_INDICATOR_LIT = np.array((1.0, 0.62, 0.05), np.float32)


def _wheels(ahead: float, radius: float, high: float) -> list[tuple[float, ...]]:
    return [
        (TYRE, a * ahead, b * 0.86, high, radius, 0.15, high, 1) for a in (-1, 1) for b in (-1, 1)
    ]


def _lights(tail_z: float, size: float) -> list[tuple[float, ...]]:
    rear = [(TAIL, -1.0, b * 0.72, tail_z, 0.012, 0.2, size, 0) for b in (-1, 1)]
    front = [(HEAD, 1.0, b * 0.7, tail_z - size, 0.012, 0.2, size, 1) for b in (-1, 1)]
    blink = [
        (RIGHT if b > 0 else LEFT, a * 0.985, b * 0.97, tail_z, 0.03, 0.06, size, 1)
        for a in (-1, 1)
        for b in (-1, 1)
    ]
    return [*rear, *front, *blink]


# (part, centre along, across, up, half length, half width, half height, small); up from the ground
_CAR: list[tuple[float, ...]] = [
    (BODY, 0, 0, 0.39, 1, 1, 0.25, 0),
    (GLASS, -0.10, 0, 0.78, 0.58, 0.86, 0.16, 0),
    (BODY, -0.12, 0, 0.965, 0.46, 0.82, 0.035, 0),
    *_wheels(0.62, 0.14, 0.21),
    *_lights(0.52, 0.05),
]
_VAN: list[tuple[float, ...]] = [
    (BODY, 0, 0, 0.36, 1, 1, 0.24, 0),
    (GLASS, 0.02, 0, 0.70, 0.90, 0.94, 0.12, 0),
    (BODY, -0.06, 0, 0.76, 0.90, 0.93, 0.24, 0),
    (GLASS, 0.70, 0, 0.74, 0.17, 0.945, 0.13, 0),
    *_wheels(0.62, 0.12, 0.14),
    *_lights(0.42, 0.05),
]
_TRUCK: list[tuple[float, ...]] = [
    (BODY, 0.72, 0, 0.42, 0.28, 0.96, 0.32, 0),
    (GLASS, 0.90, 0, 0.60, 0.105, 0.90, 0.11, 0),
    (TRIM, -0.05, 0, 0.22, 0.95, 0.80, 0.08, 0),
    (HEAD, -0.28, 0, 0.64, 0.72, 1.0, 0.36, 0),
    *_wheels(0.66, 0.14, 0.16),
    *_lights(0.30, 0.03),
]
_BUS: list[tuple[float, ...]] = [
    (BODY, 0, 0, 0.53, 1, 1, 0.42, 0),
    (GLASS, 0, 0, 0.66, 1.004, 1.01, 0.14, 0),
    (TRIM, 0, 0, 0.97, 0.96, 0.94, 0.03, 0),
    *_wheels(0.62, 0.11, 0.15),
    *_lights(0.34, 0.03),
]
_MOTORCYCLE: list[tuple[float, ...]] = [
    (BODY, 0, 0, 0.36, 0.55, 0.35, 0.14, 0),
    (TYRE, 0.68, 0, 0.20, 0.30, 0.14, 0.20, 0),
    (TYRE, -0.68, 0, 0.20, 0.30, 0.16, 0.20, 0),
    (TRIM, 0.5, 0, 0.62, 0.06, 0.95, 0.02, 1),
    (TROUSERS, -0.12, 0, 0.48, 0.22, 0.55, 0.14, 0),
    (SKIN, -0.10, 0, 0.70, 0.17, 0.62, 0.15, 0),
    (GLASS, -0.06, 0, 0.92, 0.12, 0.30, 0.08, 0),
    (TAIL, -0.80, 0, 0.42, 0.02, 0.22, 0.04, 0),
]
_BICYCLE: list[tuple[float, ...]] = [
    (BODY, 0, 0, 0.32, 0.5, 0.08, 0.10, 0),
    (TYRE, 0.62, 0, 0.19, 0.36, 0.06, 0.19, 0),
    (TYRE, -0.62, 0, 0.19, 0.36, 0.06, 0.19, 0),
    (TROUSERS, -0.14, 0, 0.45, 0.16, 0.45, 0.13, 0),
    (BODY, -0.10, 0, 0.70, 0.15, 0.62, 0.15, 0),
    (SKIN, -0.04, 0, 0.93, 0.11, 0.32, 0.07, 0),
]
_WALKER: list[tuple[float, ...]] = [
    (TROUSERS, 0, -0.38, 0.23, 0.42, 0.30, 0.23, 0),
    (TROUSERS, 0, 0.38, 0.23, 0.42, 0.30, 0.23, 0),
    (BODY, 0, 0, 0.645, 0.50, 0.95, 0.20, 0),
    (SKIN, 0.05, 0, 0.925, 0.42, 0.42, 0.075, 0),
]
_POLE: list[tuple[float, ...]] = [(TRIM, 0, 0, 0.5, 0.55, 0.55, 0.5, 0)]
# Earth spilt over the road, with lumps in it; low enough to be driven over
_DEBRIS: list[tuple[float, ...]] = [
    (EARTH, -0.10, 0.05, 0.20, 0.72, 0.58, 0.20, 0),
    (EARTH, 0.42, -0.35, 0.15, 0.50, 0.42, 0.15, 0),
    (EARTH, -0.48, 0.48, 0.13, 0.46, 0.45, 0.13, 0),
    (RUBBLE, 0.12, 0.12, 0.65, 0.20, 0.18, 0.35, 0),
    (RUBBLE, -0.40, -0.22, 0.52, 0.16, 0.14, 0.30, 1),
    (RUBBLE, 0.62, 0.50, 0.40, 0.12, 0.14, 0.40, 1),
    (RUBBLE, -0.78, 0.60, 0.34, 0.11, 0.10, 0.34, 1),
    (RUBBLE, 0.80, -0.62, 0.30, 0.13, 0.12, 0.30, 1),
]
# Its front is where its yaw points to
_VENDING_MACHINE: list[tuple[float, ...]] = [
    (CABINET, 0, 0, 0.5, 0.98, 1.0, 0.5, 0),
    (DISPLAY, 0.97, -0.22, 0.60, 0.03, 0.62, 0.30, 0),
    (TRIM, 0.97, 0.68, 0.58, 0.03, 0.16, 0.14, 1),
    (TRIM, 0.97, -0.10, 0.15, 0.03, 0.60, 0.06, 1),
]
_BY_KIND: dict[ActorKind, tuple[list[tuple[float, ...]], Tag]] = {
    ActorKind.CAR: (_CAR, Tag.CAR),
    ActorKind.VAN: (_VAN, Tag.CAR),
    ActorKind.TRUCK: (_TRUCK, Tag.TRUCK),
    ActorKind.BUS: (_BUS, Tag.BUS),
    ActorKind.MOTORCYCLE: (_MOTORCYCLE, Tag.MOTORCYCLE),
    ActorKind.BICYCLE: (_BICYCLE, Tag.BICYCLE),
    ActorKind.WALKER: (_WALKER, Tag.PEDESTRIANS),
    ActorKind.PROP: (_POLE, Tag.POLES),
    ActorKind.DEBRIS: (_DEBRIS, Tag.STATIC),
    ActorKind.VENDING_MACHINE: (_VENDING_MACHINE, Tag.DYNAMIC),
}
_RIDER_PARTS = (TROUSERS, SKIN)


def _table() -> tuple[np.ndarray, np.ndarray]:
    rows: list[tuple[float, ...]] = []
    start = [0]
    for kind in range(max(ActorKind) + 1):
        parts, tag = _BY_KIND.get(ActorKind(kind), ([], Tag.NONE))
        two_wheels = kind in (ActorKind.MOTORCYCLE, ActorKind.BICYCLE)
        for part in parts:
            rider = two_wheels and (part[0] in _RIDER_PARTS or part[3] > 0.6)
            rows.append((*part, Tag.RIDER if rider else tag))
        start.append(len(rows))
    return np.array(rows, np.float64), np.array(start, np.int64)


PARTS, PART_START = _table()


@kernel
def add_actor(state, actor, detailed, base, parts, part_start, out):
    """Appends the boxes of one actor.

    Args:
        state: `State` of the world.
        actor: Its index.
        detailed: Whether small parts are wanted.
        base: Unused height to add [m].
        parts: `PARTS`.
        part_start: `PART_START`.
        out: `Boxes` to append to.
    """
    kind = state.kind[actor]
    c, s = math.cos(state.yaw[actor]), math.sin(state.yaw[actor])
    draw = int(keyed_hash(state.seed[()], _VEHICLE_COLOUR, 0, actor) & np.uint64(0xFFFF))
    blink = (state.tick[()] // 8) % 2 == 0
    for row in range(part_start[kind], part_start[kind + 1]):
        part = parts[row]
        role = int(part[0])
        lit_brake = role == TAIL and state.brake_light[actor] != 0
        side = state.indicator[actor]
        lit_side = blink and ((role == LEFT and side < 0) or (role == RIGHT and side > 0))
        lit = lit_brake or lit_side
        if (part[7] != 0.0 and not detailed and not lit) or out.count[0] >= out.yaw.shape[0]:
            continue
        at = out.count[0]
        along = part[1] * state.half_length[actor]
        across = part[2] * state.half_width[actor]
        out.centre[at, 0] = state.x[actor] + c * along - s * across
        out.centre[at, 1] = state.y[actor] + s * along + c * across
        out.centre[at, 2] = state.z[actor] + part[3] * state.height[actor] + base
        out.half[at, 0] = part[4] * state.half_length[actor]
        out.half[at, 1] = part[5] * state.half_width[actor]
        out.half[at, 2] = part[6] * state.height[actor]
        for axis in range(3):
            colour = _BODIES[draw % 8, axis] if role == BODY else _FIXED[role, axis]
            if lit_brake:
                colour = _BRAKE_LIT[axis]
            elif lit_side:
                colour = _INDICATOR_LIT[axis]
            out.colour[at, axis] = colour
        out.yaw[at] = state.yaw[actor]
        out.pitch[at] = 0.0
        out.tag[at] = np.uint8(part[8])
        out.material[at] = _LAMP if lit else _PLAIN
        out.instance[at] = actor + 1
        out.count[0] = at + 1
