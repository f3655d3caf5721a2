"""Actors as boxes: the parts of each, put in their place and coloured; its lamps lit or dark.

Who was knocked down lies: people on their faces, their heads ahead; two wheels on their right side.
"""

from __future__ import annotations

import math

import numpy as np

from di_envs.numerics.arrays import Float32
from di_envs.numerics.kernels import kernel
from di_envs.numerics.keyed_random import Stream, keyed_hash
from di_envs.sensors.scene.actor_parts import (
    BODY_COLOURS,
    BRAKE_LIT,
    INDICATOR_LIT,
    ROLE_COLOURS,
    Parts,
    Role,
)
from di_envs.sensors.scene.boxes import Boxes, Material, turn_box
from di_envs.world.kinds import ActorKind
from di_envs.world.state import State
from di_envs.world.struck import DOWN

DETAIL_M = 60.0  # beyond which only the large parts are drawn
_BLINK_TICKS = 8  # that an indicator is lit, and then dark
_VEHICLE_COLOUR = int(Stream.VEHICLE_COLOUR)
_BODY, _TAIL, _LEFT, _RIGHT = int(Role.BODY), int(Role.TAIL), int(Role.LEFT), int(Role.RIGHT)
_WALKER = int(ActorKind.WALKER)
_PLAIN, _LAMP = int(Material.PLAIN), int(Material.LAMP)
_DARK, _BRAKING, _BLINKING = range(3)  # what shines in a part


@kernel
def add_actor(state: State, actor: int, detailed: bool, parts: Parts, out: Boxes) -> None:
    """Appends the boxes of one actor; those that find no room are left out.

    Args:
        state: Of the world.
        actor: Its index.
        detailed: Whether small parts are wanted; what is lit is drawn anyway.
        parts: What actors are made of.
        out: Boxes to append to.
    """
    kind = state.kind[actor]
    c, s = math.cos(state.yaw[actor]), math.sin(state.yaw[actor])
    body = int(keyed_hash(state.seed[()], _VEHICLE_COLOUR, 0, actor) & np.uint64(0xFFFF)) % len(
        BODY_COLOURS
    )
    for part in range(parts.start[kind], parts.start[kind + 1]):
        light = _light_of(state, actor, parts.role[part])
        if parts.small[part] != 0 and not detailed and light == _DARK:
            continue
        at = out.count[0]
        if at >= out.yaw.shape[0]:
            return
        _place_part(state, actor, parts, part, c, s, out, at)
        _colour_part(parts.role[part], light, body, out.colour[at])
        out.tag[at] = parts.tag[part]
        out.material[at] = _PLAIN if light == _DARK else _LAMP
        out.instance[at] = actor + 1
        out.count[0] = at + 1


@kernel
def _light_of(state: State, actor: int, role: int) -> int:
    """What shines in a part at this moment."""
    if role == _TAIL and state.brake_light[actor] != 0:
        return _BRAKING
    side = state.indicator[actor]
    if (role == _LEFT and side < 0) or (role == _RIGHT and side > 0):
        if (state.tick[()] // _BLINK_TICKS) % 2 == 0:
            return _BLINKING
    return _DARK


@kernel
def _place_part(
    state: State, actor: int, parts: Parts, part: int, c: float, s: float, out: Boxes, at: int
) -> None:
    """Writes where box `at` is and how large; c and s are of the actor's yaw."""
    sizes = (state.half_length[actor], state.half_width[actor], state.height[actor])
    along, across, up = (
        parts.at[part, 0] * sizes[0],
        parts.at[part, 1] * sizes[1],
        parts.at[part, 2] * sizes[2],
    )
    for axis in range(3):
        out.half[at, axis] = parts.half[part, axis] * sizes[axis]
    if state.walk_waiting[actor] == DOWN:
        if state.kind[actor] == _WALKER:
            along, up = up - 0.5 * sizes[2], sizes[0] - along
            down = 0
        else:
            across, up = up - 0.5 * sizes[2], sizes[1] - across
            down = 1
        out.half[at, 2], out.half[at, down] = out.half[at, down], out.half[at, 2]
    out.centre[at, 0] = state.x[actor] + c * along - s * across
    out.centre[at, 1] = state.y[actor] + s * along + c * across
    out.centre[at, 2] = state.z[actor] + up
    turn_box(out, at, state.yaw[actor])
    out.pitch[at] = 0.0


@kernel
def _colour_part(role: int, light: int, body: int, colour: Float32) -> None:
    """Writes a part's colour (3,), 0..1; `body` is the row of the actor's own."""
    for axis in range(3):
        if light == _BRAKING:
            colour[axis] = BRAKE_LIT[axis]
        elif light == _BLINKING:
            colour[axis] = INDICATOR_LIT[axis]
        elif role == _BODY:
            colour[axis] = BODY_COLOURS[body, axis]
        else:
            colour[axis] = ROLE_COLOURS[role, axis]
