"""The arms of a junction and the ways across it: who may turn where, on which lanes.

Frame: OpenDRIVE's, x east, y north [m], angles counter-clockwise [rad].
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from di_envs.town.building.alignment import Pose, wrapped
from di_envs.town.building.street_plan import Junction, Street, StreetPlan
from di_envs.town.lanes import Turn

_STRAIGHT_RAD = math.radians(45.0)


@dataclass(frozen=True)
class StreetEnd:
    """An arm of a junction: the end of a street there."""

    street: Street
    contact: str  # which end of the street: "start" or "end"
    mouth: Pose  # the street's middle there, heading into the junction

    @property
    def inbound_sign(self) -> int:
        """Sign of the ids of the lanes that lead into the junction."""
        return -1 if self.contact == "end" else 1

    def lane_id(self, lane: int, *, inbound: bool) -> int:
        """Lane id of driving lane 1, 2, … counted from the middle."""
        number = self.street.section.first_lane + lane - 1
        return number * (self.inbound_sign if inbound else -self.inbound_sign)

    def inbound_edge(self, right_m: float) -> Pose:
        """The mouth's pose `right_m` beside the middle, for those who enter."""
        return self.mouth.shifted(0.0, -right_m)

    def outbound_edge(self, right_m: float) -> Pose:
        """The mouth's pose `right_m` beside the middle, for those who leave."""
        return self.mouth.reversed().shifted(0.0, -right_m)

    def turn_to(self, other: StreetEnd) -> float:
        """Change of heading from this arm into the other one [rad], left positive."""
        return wrapped(other.mouth.heading + math.pi - self.mouth.heading)


@dataclass(frozen=True)
class Movement:
    """Lanes that lead from one arm into another: `lanes` of them beside each other."""

    source: StreetEnd
    target: StreetEnd
    turn: Turn
    source_lane: int  # the innermost of them
    target_lane: int
    lanes: int


def arms_of(junction: Junction, plan: StreetPlan) -> list[StreetEnd]:
    """The arms of a junction, in the order of the plan's streets."""
    arms = []
    for street in plan.streets:
        curve = street.curve()
        if street.start == junction.id:
            arms.append(StreetEnd(street, "start", curve[0].start.reversed()))
        if street.end == junction.id:
            arms.append(StreetEnd(street, "end", curve[-1].end))
    return arms


def movements(junction: Junction, arms: list[StreetEnd]) -> Iterator[Movement]:
    """Every permitted way across: lane i goes straight on into lane i, the innermost lane also
    turns left into the innermost, and the outermost lane turns right into the outermost."""
    for source in arms:
        for target in arms:
            if target is source:
                continue
            turn = source.turn_to(target)
            n_from, n_to = source.street.section.lanes, target.street.section.lanes
            if abs(turn) < _STRAIGHT_RAD:
                yield Movement(source, target, Turn.STRAIGHT, 1, 1, min(n_from, n_to))
            elif turn < 0.0:
                yield Movement(source, target, Turn.RIGHT, n_from, n_to, 1)
            elif junction.left_turns:
                yield Movement(source, target, Turn.LEFT, 1, 1, 1)


def corner_pairs(arms: list[StreetEnd]) -> list[tuple[StreetEnd, StreetEnd]]:
    """Neighbouring arms, each with the one to its right, where both have a sidewalk."""
    pairs = []
    for arm in arms:
        right = min((other for other in arms if other is not arm), key=arm.turn_to)
        if arm.street.section.sidewalk_m > 0.0 and right.street.section.sidewalk_m > 0.0:
            pairs.append((arm, right))
    return pairs
