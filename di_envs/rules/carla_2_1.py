"""The rules of CARLA's Leaderboard 2.1: costs are added up, not multiplied.

The score is 1 / (1 + sum of costs), times the share of the way inside the lanes, which stays a
factor. The route completion is rounded before it is multiplied.

Source: CARLA Leaderboard, statistics manager of the branch `leaderboard-2.1` (numbers; written
anew). `docs/rules.md` says what CARLA's own code does besides.
"""

from __future__ import annotations

from di_envs.rules.penalties import Form, Penalties
from di_envs.rules.rule_set import Layout, Rules
from di_envs.world.kinds import EventKind

CARLA_2_1 = Rules(
    name="carla-2.1",
    penalties=Penalties(
        form=Form.SUM,
        costs={
            EventKind.COLLISION_WALKER: 1.00,
            EventKind.COLLISION_VEHICLE: 0.70,
            EventKind.COLLISION_STATIC: 0.60,
            EventKind.RED_LIGHT: 0.40,
            EventKind.STOP_SIGN: 0.25,
        },
        min_speed=0.40,
    ),
    layout=Layout.V2,
    completion_decimals=2,
)
