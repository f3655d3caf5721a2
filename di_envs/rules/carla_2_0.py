"""The rules of CARLA's Leaderboard 2.0: those of 1.0, and a minimum speed.

An ego slower than the traffic loses up to 0.30 of its score at each checkpoint, in proportion. The
route completion is rounded before it is multiplied, and a route without an infraction is `Perfect`.

Source: CARLA Leaderboard, statistics manager of the branch `leaderboard-2.0` (numbers; written
anew). `docs/rules.md` says what CARLA's own code does besides.
"""

from __future__ import annotations

from di_envs.rules.carla_1_0 import CARLA_1_0
from di_envs.rules.penalties import Form, Penalties
from di_envs.rules.rule_set import Layout, Rules

CARLA_2_0 = Rules(
    name="carla-2.0",
    penalties=Penalties(
        form=Form.PRODUCT,
        costs=CARLA_1_0.penalties.costs,
        min_speed=0.30,
    ),
    layout=Layout.V2,
    completion_decimals=2,
)
