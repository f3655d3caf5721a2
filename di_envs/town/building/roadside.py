"""What stands and lies at the arms of a junction: lights, stop signs, light groups, crosswalks.

Frame: OpenDRIVE's, x east, y north [m], angles counter-clockwise [rad].
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from di_envs.town.building.alignment import Curve, Pose, length_of, pose_at, wrapped
from di_envs.town.building.junction_arms import StreetEnd
from di_envs.town.building.opendrive_writer import (
    CrosswalkDraft,
    RoadDraft,
    RoadEnd,
    SignalDraft,
)
from di_envs.town.building.street_plan import Control, Junction

_CROSSWALK_AHEAD_M = 2.0  # its middle beyond the mouth, which is the stop line
_CROSSWALK_WIDTH_M = 3.0
_SIGNAL_BEFORE_MOUTH_M = 0.1
_LIGHT, _STOP = "1000001", "206"


def heads_of(
    junction: Junction, arms: list[StreetEnd], signal_ids: Iterator[int]
) -> list[tuple[StreetEnd, SignalDraft]]:
    """A light or stop sign at the right of every arm that has to heed one."""
    stem = max(arms, key=lambda arm: min(abs(arm.turn_to(o)) for o in arms if o is not arm))
    kind = _LIGHT if junction.control is Control.LIGHTS else _STOP
    heads = []
    for arm in arms:
        if junction.control is Control.STOP_STEM and arm is not stem:
            continue
        section = arm.street.section
        station = length_of(arm.street.curve()) - _SIGNAL_BEFORE_MOUTH_M
        right = section.paved_m + section.shoulder_m + section.kerb_m / 2.0
        head = SignalDraft(
            id=next(signal_ids),
            name=f"{'Light' if kind == _LIGHT else 'Stop'} {junction.id} of {arm.street.id}",
            type=kind,
            station_m=station if arm.contact == "end" else _SIGNAL_BEFORE_MOUTH_M,
            left_m=right * arm.inbound_sign,
            sign=arm.inbound_sign,
        )
        heads.append((arm, head))
    return heads


def controllers_of(
    junction: Junction, heads: list[tuple[StreetEnd, SignalDraft]], ids: Iterator[int]
) -> tuple[tuple[int, tuple[int, ...]], ...]:
    """The light groups in the order of their turns: one an arm, but for those named together."""
    if junction.control is not Control.LIGHTS:
        return ()
    groups: dict[tuple[int, ...], list[int]] = {}
    for arm, head in heads:
        street = arm.street.id
        together = next((group for group in junction.one_phase if street in group), (street,))
        groups.setdefault(together, []).append(head.id)
    return tuple((next(ids), tuple(signals)) for signals in groups.values())


def with_crosswalk(
    roads: list[RoadDraft], corners: list[RoadDraft], arm: StreetEnd, ids: Iterator[int]
) -> list[RoadDraft]:
    """Adds the crosswalk over an arm's mouth, where both of its corners have a sidewalk."""
    right = next((road for road in corners if _leaves(road.predecessor, arm)), None)
    left = next((road for road in corners if _leaves(road.successor, arm)), None)
    if right is None or left is None:
        return roads
    index = next(i for i, road in enumerate(roads) if _starts_in_middle(road, arm))
    road = roads[index]
    station = _station_ahead(road.curve, arm.mouth, _CROSSWALK_AHEAD_M)
    pose = pose_at(road.curve, station)
    _, offset = arm.mouth.local(pose.x, pose.y)
    to_left = _sidewalk_left_of(left, arm.mouth) - offset
    to_right = _sidewalk_left_of(right, arm.mouth) - offset
    half = _CROSSWALK_WIDTH_M / 2.0
    walk = CrosswalkDraft(
        id=next(ids),
        station_m=station,
        heading_rad=wrapped(arm.mouth.heading + math.pi / 2.0 - pose.heading),
        outline=((to_left, half), (to_left, -half), (to_right, -half), (to_right, half)),
    )
    changed = replace(road, crosswalks=(*road.crosswalks, walk))
    return [*roads[:index], changed, *roads[index + 1 :]]


def _leaves(end: RoadEnd, arm: StreetEnd) -> bool:
    return end.id == arm.street.id and end.contact == arm.contact


def _starts_in_middle(road: RoadDraft, arm: StreetEnd) -> bool:
    innermost = arm.lane_id(1, inbound=True)
    return _leaves(road.predecessor, arm) and road.predecessor.lanes[-1] == innermost


def _station_ahead(curve: Curve, mouth: Pose, ahead_m: float) -> float:
    """The station at which a curve that starts at a mouth is `ahead_m` beyond it."""
    low, high = 0.0, length_of(curve)
    for _ in range(60):
        middle = 0.5 * (low + high)
        pose = pose_at(curve, middle)
        low, high = (middle, high) if mouth.local(pose.x, pose.y)[0] < ahead_m else (low, middle)
    return low


def _sidewalk_left_of(corner: RoadDraft, mouth: Pose) -> float:
    """How far left of a mouth's middle a corner's sidewalk passes the crosswalk [m]."""
    inside = sum(strip.width_m for strip in corner.right) - corner.right[-1].width_m / 2.0
    steps = range(101)
    poses = [pose_at(corner.curve, length_of(corner.curve) * i / 100.0) for i in steps]
    beside = [pose.shifted(0.0, -inside) for pose in poses]
    places = [mouth.local(pose.x, pose.y) for pose in beside]
    off = min(abs(ahead - _CROSSWALK_AHEAD_M) for ahead, _ in places)
    reached = [left for ahead, left in places if abs(ahead - _CROSSWALK_AHEAD_M) < off + 0.1]
    return min(reached, key=abs)
