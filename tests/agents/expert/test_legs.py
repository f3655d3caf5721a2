"""A route's legs where lanes change late, on roads so short that no point of the route is on them.

Two lanes run east: 60 m of road 0, then 1 m of road 1, then a junction with a way from each.
"""

from __future__ import annotations

import numpy as np

from agents.expert.legs import Leg, join_legs, make_room
from tests.di_envs.world.small_world import LaneSpec, make_lanes

LEFT, RIGHT, TINY_LEFT, TINY_RIGHT, WAY_LEFT, WAY_RIGHT = range(6)
LANES = make_lanes(
    (
        LaneSpec(start=(0, 0), end=(60, 0), road=0, lane_id=-1, successors=(TINY_LEFT,)),
        LaneSpec(start=(0, 3.5), end=(60, 3.5), road=0, lane_id=-2, successors=(TINY_RIGHT,)),
        LaneSpec(start=(60, 0), end=(61, 0), road=1, lane_id=-1, successors=(WAY_LEFT,)),
        LaneSpec(start=(60, 3.5), end=(61, 3.5), road=1, lane_id=-2, successors=(WAY_RIGHT,)),
        LaneSpec(start=(61, 0), end=(81, 0), road=2, lane_id=-1, junction=0),
        LaneSpec(start=(61, 3.5), end=(81, 3.5), road=3, lane_id=-1, junction=0),
    )
)._replace(
    left=np.array([-1, LEFT, -1, TINY_LEFT, -1, -1], np.int32),
    right=np.array([RIGHT, -1, TINY_RIGHT, -1, -1, -1], np.int32),
)


def joined() -> list[Leg]:
    """The legs of a route that changes to the right lane on the last metre."""
    legs = [Leg(LEFT, 10.0, 59.5), Leg(TINY_LEFT, 0.0, 0.0), Leg(WAY_RIGHT, 6.0, 20.0)]
    return join_legs(legs, LANES)


def test_a_change_on_the_last_metre_comes_to_the_junction_by_the_end_of_the_lane_beside():
    """So that the stop line there is on the path."""
    assert [vars(leg) for leg in joined()] == [
        {"lane": LEFT, "begin_m": 10.0, "end_m": 60.0},
        {"lane": TINY_LEFT, "begin_m": 0.0, "end_m": 0.0},
        {"lane": TINY_RIGHT, "begin_m": 1.0, "end_m": 1.0},
        {"lane": WAY_RIGHT, "begin_m": 0.0, "end_m": 20.0},
    ]


def test_it_is_made_on_the_road_before_where_the_last_one_is_too_short():
    legs = joined()
    make_room(legs, LANES)
    assert [leg.lane for leg in legs] == [LEFT, RIGHT, TINY_RIGHT, WAY_RIGHT]
    assert (legs[0].end_m, legs[1].begin_m) == (26.0, 26.0)  # 34 m, and one more behind them
    assert (legs[2].begin_m, legs[2].end_m) == (0.0, 1.0)
