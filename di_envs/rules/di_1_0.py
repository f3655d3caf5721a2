"""Our own rules: those of CARLA's Leaderboard 1.0, with its two holes closed.

A red light counts wherever the tail crosses the stop line, at the lane's edge and on the wrong side
of the road too, where CARLA's line ends 0.4 lane widths from the middle. Each body counts once,
when it is hit for the first time: CARLA counts one again after five seconds, and overlooks whom one
hits within three metres of somebody else. What each costs is as in 1.0.
"""

from __future__ import annotations

from di_envs.rules.carla_1_0 import CARLA_1_0
from di_envs.rules.penalties import Form, Penalties
from di_envs.rules.rule_set import Layout, Rules
from di_envs.world.kinds import EventKind

# what is seen in the place of what CARLA sees, and costs the same
SEEN_INSTEAD = {
    EventKind.COLLISION_WALKER: EventKind.FIRST_HIT_WALKER,
    EventKind.COLLISION_VEHICLE: EventKind.FIRST_HIT_VEHICLE,
    EventKind.COLLISION_STATIC: EventKind.FIRST_HIT_STATIC,
    EventKind.RED_LIGHT: EventKind.RED_LIGHT_WIDE,
}

DI_1_0 = Rules(
    name="di-1.0",
    penalties=Penalties(
        form=Form.PRODUCT,
        costs={
            SEEN_INSTEAD.get(kind, kind): cost for kind, cost in CARLA_1_0.penalties.costs.items()
        },
    ),
    layout=Layout.V1,
    ignored=frozenset({EventKind.SCENARIO, EventKind.MIN_SPEED, *SEEN_INSTEAD}),
    since_world=2,
)
