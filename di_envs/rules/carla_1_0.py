"""The rules of CARLA's Leaderboard 1.0, which the paper goes by.

Each infraction multiplies the score. There is no minimum speed: where the world notes one, it costs
nothing here.

Source: CARLA Leaderboard, statistics manager of the branch `leaderboard-1.0` (numbers; written
anew). `docs/rules.md` says what CARLA's own code does besides.
"""

from __future__ import annotations

from di_envs.rules.penalties import Form, Penalties
from di_envs.rules.rule_set import NOT_CARLAS, Layout, Rules
from di_envs.world.kinds import EventKind

CARLA_1_0 = Rules(
    name="carla-1.0",
    penalties=Penalties(
        form=Form.PRODUCT,
        costs={
            EventKind.COLLISION_WALKER: 0.50,
            EventKind.COLLISION_VEHICLE: 0.60,
            EventKind.COLLISION_STATIC: 0.65,
            EventKind.RED_LIGHT: 0.70,
            EventKind.STOP_SIGN: 0.80,
        },
    ),
    layout=Layout.V1,
    ignored=NOT_CARLAS | {EventKind.MIN_SPEED},
)
