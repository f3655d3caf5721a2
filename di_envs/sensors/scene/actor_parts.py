"""What actors are made of: each kind of vehicle, walker and prop as a handful of boxes, as tables.

A part's place and size are shares of the actor's own box (half length, half width, height), so one
table serves every size.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from di_envs.numerics.arrays import Float64, Int8, Int64, UInt8
from di_envs.numerics.bundles import by_reference
from di_envs.sensors.scene.tags import Tag
from di_envs.world.kinds import ActorKind


class Role(IntEnum):
    """What a part is, and so its colour; BODY takes the actor's own."""

    BODY = 0
    GLASS = 1
    TYRE = 2
    TAIL = 3
    LEFT = 4
    RIGHT = 5
    HEAD = 6
    TRIM = 7
    TROUSERS = 8
    SKIN = 9
    EARTH = 10
    RUBBLE = 11
    CABINET = 12
    DISPLAY = 13


class Part(NamedTuple):
    """One box of an actor; its pitch is 0 and its yaw the actor's."""

    role: Role
    at: tuple[float, float, float]  # its middle: along, across (positive right), up from the ground
    half: tuple[float, float, float]  # half length, width, height
    small: bool = False  # left out far away


@by_reference
class Parts(NamedTuple):
    """The N parts of all kinds of actors; those of kind k are [start[k], start[k + 1])."""

    start: Int64  # (kinds + 1,)
    role: Int8  # (N,) Role
    at: Float64  # (N, 3) as in `Part`
    half: Float64  # (N, 3)
    small: Int8  # (N,) 0 or 1
    tag: UInt8  # (N,) Tag


# Colours of cars, drawn by key: whites, greys and blacks mostly, as on real streets
BODY_COLOURS = np.array(
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
ROLE_COLOURS = np.array(
    [
        (0.0, 0.0, 0.0),  # body: its own colour
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
BRAKE_LIT = np.array((1.0, 0.10, 0.06), np.float32)
INDICATOR_LIT = np.array((1.0, 0.62, 0.05), np.float32)


def _wheels(ahead: float, radius: float, high: float) -> list[Part]:
    return [
        Part(Role.TYRE, (a * ahead, b * 0.86, high), (radius, 0.15, high), small=True)
        for a in (-1, 1)
        for b in (-1, 1)
    ]


def _lights(tail_z: float, size: float) -> list[Part]:
    rear = [Part(Role.TAIL, (-1.0, b * 0.72, tail_z), (0.012, 0.2, size)) for b in (-1, 1)]
    front = [
        Part(Role.HEAD, (1.0, b * 0.7, tail_z - size), (0.012, 0.2, size), small=True)
        for b in (-1, 1)
    ]
    blink = [
        Part(
            Role.RIGHT if b > 0 else Role.LEFT,
            (a * 0.985, b * 0.97, tail_z),
            (0.03, 0.06, size),
            small=True,
        )
        for a in (-1, 1)
        for b in (-1, 1)
    ]
    return [*rear, *front, *blink]


_CAR: list[Part] = [
    Part(Role.BODY, (0, 0, 0.39), (1, 1, 0.25)),
    Part(Role.GLASS, (-0.10, 0, 0.78), (0.58, 0.86, 0.16)),
    Part(Role.BODY, (-0.12, 0, 0.965), (0.46, 0.82, 0.035)),
    *_wheels(0.62, 0.14, 0.21),
    *_lights(0.52, 0.05),
]
_VAN: list[Part] = [
    Part(Role.BODY, (0, 0, 0.36), (1, 1, 0.24)),
    Part(Role.GLASS, (0.02, 0, 0.70), (0.90, 0.94, 0.12)),
    Part(Role.BODY, (-0.06, 0, 0.76), (0.90, 0.93, 0.24)),
    Part(Role.GLASS, (0.70, 0, 0.74), (0.17, 0.945, 0.13)),
    *_wheels(0.62, 0.12, 0.14),
    *_lights(0.42, 0.05),
]
_TRUCK: list[Part] = [
    Part(Role.BODY, (0.72, 0, 0.42), (0.28, 0.96, 0.32)),
    Part(Role.GLASS, (0.90, 0, 0.60), (0.105, 0.90, 0.11)),
    Part(Role.TRIM, (-0.05, 0, 0.22), (0.95, 0.80, 0.08)),
    Part(Role.HEAD, (-0.28, 0, 0.64), (0.72, 1.0, 0.36)),
    *_wheels(0.66, 0.14, 0.16),
    *_lights(0.30, 0.03),
]
_BUS: list[Part] = [
    Part(Role.BODY, (0, 0, 0.53), (1, 1, 0.42)),
    Part(Role.GLASS, (0, 0, 0.66), (1.004, 1.01, 0.14)),
    Part(Role.TRIM, (0, 0, 0.97), (0.96, 0.94, 0.03)),
    *_wheels(0.62, 0.11, 0.15),
    *_lights(0.34, 0.03),
]
_MOTORCYCLE: list[Part] = [
    Part(Role.BODY, (0, 0, 0.36), (0.55, 0.35, 0.14)),
    Part(Role.TYRE, (0.68, 0, 0.20), (0.30, 0.14, 0.20)),
    Part(Role.TYRE, (-0.68, 0, 0.20), (0.30, 0.16, 0.20)),
    Part(Role.TRIM, (0.5, 0, 0.62), (0.06, 0.95, 0.02), small=True),
    Part(Role.TROUSERS, (-0.12, 0, 0.48), (0.22, 0.55, 0.14)),
    Part(Role.SKIN, (-0.10, 0, 0.70), (0.17, 0.62, 0.15)),
    Part(Role.GLASS, (-0.06, 0, 0.92), (0.12, 0.30, 0.08)),
    Part(Role.TAIL, (-0.80, 0, 0.42), (0.02, 0.22, 0.04)),
]
_BICYCLE: list[Part] = [
    Part(Role.BODY, (0, 0, 0.32), (0.5, 0.08, 0.10)),
    Part(Role.TYRE, (0.62, 0, 0.19), (0.36, 0.06, 0.19)),
    Part(Role.TYRE, (-0.62, 0, 0.19), (0.36, 0.06, 0.19)),
    Part(Role.TROUSERS, (-0.14, 0, 0.45), (0.16, 0.45, 0.13)),
    Part(Role.BODY, (-0.10, 0, 0.70), (0.15, 0.62, 0.15)),
    Part(Role.SKIN, (-0.04, 0, 0.93), (0.11, 0.32, 0.07)),
]
_WALKER: list[Part] = [
    Part(Role.TROUSERS, (0, -0.38, 0.23), (0.42, 0.30, 0.23)),
    Part(Role.TROUSERS, (0, 0.38, 0.23), (0.42, 0.30, 0.23)),
    Part(Role.BODY, (0, 0, 0.645), (0.50, 0.95, 0.20)),
    Part(Role.SKIN, (0.05, 0, 0.925), (0.42, 0.42, 0.075)),
]
_POLE: list[Part] = [Part(Role.TRIM, (0, 0, 0.5), (0.55, 0.55, 0.5))]
# Earth spilt over the road, with lumps in it; low enough to be driven over
_DEBRIS: list[Part] = [
    Part(Role.EARTH, (-0.10, 0.05, 0.20), (0.72, 0.58, 0.20)),
    Part(Role.EARTH, (0.42, -0.35, 0.15), (0.50, 0.42, 0.15)),
    Part(Role.EARTH, (-0.48, 0.48, 0.13), (0.46, 0.45, 0.13)),
    Part(Role.RUBBLE, (0.12, 0.12, 0.65), (0.20, 0.18, 0.35)),
    Part(Role.RUBBLE, (-0.40, -0.22, 0.52), (0.16, 0.14, 0.30), small=True),
    Part(Role.RUBBLE, (0.62, 0.50, 0.40), (0.12, 0.14, 0.40), small=True),
    Part(Role.RUBBLE, (-0.78, 0.60, 0.34), (0.11, 0.10, 0.34), small=True),
    Part(Role.RUBBLE, (0.80, -0.62, 0.30), (0.13, 0.12, 0.30), small=True),
]
# Its front is where its yaw points to
_VENDING_MACHINE: list[Part] = [
    Part(Role.CABINET, (0, 0, 0.5), (0.98, 1.0, 0.5)),
    Part(Role.DISPLAY, (0.97, -0.22, 0.60), (0.03, 0.62, 0.30)),
    Part(Role.TRIM, (0.97, 0.68, 0.58), (0.03, 0.16, 0.14), small=True),
    Part(Role.TRIM, (0.97, -0.10, 0.15), (0.03, 0.60, 0.06), small=True),
]
_BY_KIND: dict[ActorKind, tuple[list[Part], Tag]] = {
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
_RIDER_PARTS = (Role.TROUSERS, Role.SKIN)


def _tag_of(kind: ActorKind, part: Part, tag: Tag) -> Tag:
    """A part's tag: its actor's, but for who sits on a bicycle or a motorcycle."""
    two_wheels = kind in (ActorKind.MOTORCYCLE, ActorKind.BICYCLE)
    rider = two_wheels and (part.role in _RIDER_PARTS or part.at[2] > 0.6)
    return Tag.RIDER if rider else tag


def _parts() -> Parts:
    found: list[Part] = []
    tags: list[Tag] = []
    start = [0]
    for number in range(max(ActorKind) + 1):
        parts, tag = _BY_KIND.get(ActorKind(number), ([], Tag.NONE))
        found += parts
        tags += [_tag_of(ActorKind(number), part, tag) for part in parts]
        start.append(len(found))
    return Parts(
        start=np.array(start, np.int64),
        role=np.array([part.role for part in found], np.int8),
        at=np.array([part.at for part in found], np.float64),
        half=np.array([part.half for part in found], np.float64),
        small=np.array([part.small for part in found], np.int8),
        tag=np.array(tags, np.uint8),
    )


PARTS = _parts()
