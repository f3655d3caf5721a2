"""The reader against CARLA's own, on CARLA's maps.

The `carla` wheel reads OpenDRIVE without a server. Lanes here may span several of CARLA's lane
sections, so lanes are compared by where they lie.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from di_envs.town.lanes import LaneKind, SignalKind
from di_envs.town.loading import load_town
from di_envs.town.queries import pose_at, project_to_lane, segment_at, width_at
from di_envs.town.town import Town
from tests.carla_wheel import carla_wheel

carla = carla_wheel()

MAPS = ("Town01", "Town01_2020", "Town04_2020", "Town05")


@dataclass
class Pair:
    """A town of ours and the same one of CARLA's."""

    town: Town
    map: Any
    driving: dict[int, list[int]] = field(default_factory=dict)  # CARLA's road id -> our lanes

    def locate(self, waypoint: Any) -> tuple[int, float, float]:
        """Our lane of the waypoint's road that is nearest to it, the station, the distance."""
        place, yaw = waypoint.transform.location, math.radians(waypoint.transform.rotation.yaw)
        best = (-1, 0.0, math.inf)
        for lane in self.driving[waypoint.road_id]:
            s, _ = project_to_lane(self.town.lanes, lane, place.x, place.y)
            x, y, _, own_yaw = pose_at(self.town.lanes, lane, s)
            away = math.hypot(x - place.x, y - place.y)
            if away < best[2] and math.cos(own_yaw - yaw) > 0.0:
                best = (lane, s, away)
        return best


@pytest.fixture(scope="module", params=MAPS)
def pair(request, shared, tmp_path_factory):
    path = shared / "data" / "xodr" / f"{request.param}.xodr"
    town = load_town(path, "none", cache_folder=tmp_path_factory.mktemp("cache"))
    pair = Pair(town, carla.Map(request.param, town.opendrive))
    for lane in np.flatnonzero(town.lanes.kind == LaneKind.DRIVING):
        road = int(town.road_names[town.lanes.road[lane]])
        pair.driving.setdefault(road, []).append(int(lane))
    return pair


def test_lane_centres_headings_and_widths_are_carlas(pair):
    rows = []
    for waypoint in pair.map.generate_waypoints(4.0):
        lane, s, away = pair.locate(waypoint)
        assert lane >= 0
        _, _, z, yaw = pose_at(pair.town.lanes, lane, s)
        turn = math.degrees(yaw) - waypoint.transform.rotation.yaw
        rows.append(
            (
                away,
                abs((turn + 180.0) % 360.0 - 180.0),
                abs(z - waypoint.transform.location.z),
                abs(width_at(pair.town.lanes, lane, s) - waypoint.lane_width),
            )
        )
    away, turn, height, width = np.array(rows).T
    assert np.percentile(away, 99) <= 0.01
    assert away.max() <= 0.05
    assert np.percentile(turn, 99) <= 0.5
    assert height.max() <= 0.01
    assert width.max() <= 1e-3


def test_every_lane_of_carlas_is_one_of_ours_and_the_other_way_round(pair):
    found = {pair.locate(waypoint)[0] for waypoint in pair.map.generate_waypoints(2.0)}
    lanes = pair.town.lanes
    ours = set(np.flatnonzero((lanes.kind == LaneKind.DRIVING) & (lanes.length_m > 4.0)))
    assert ours <= found


def carlas_waypoint(pair: Pair, lane: int) -> Any:
    """CARLA's waypoint 0.3 m before the end of a lane of ours."""
    lanes = pair.town.lanes
    i, _ = segment_at(lanes, lane, max(lanes.length_m[lane] - 0.3, 0.5 * lanes.length_m[lane]))
    road = int(pair.town.road_names[lanes.road[lane]])
    for lane_id in range(-10, 11):
        waypoint = pair.map.get_waypoint_xodr(road, lane_id, float(lanes.road_m[i]))
        if waypoint is not None and waypoint.lane_type == carla.LaneType.Driving:
            found, _, away = pair.locate(waypoint)
            if found == lane and away < 0.1:
                return waypoint
    return None


def test_successors_are_carlas(pair):
    lanes, equal = pair.town.lanes, []
    for lane in np.flatnonzero(lanes.kind == LaneKind.DRIVING):
        waypoint = carlas_waypoint(pair, int(lane))
        assert waypoint is not None
        theirs = {pair.locate(after)[0] for after in waypoint.next(1.0)} - {int(lane)}
        ours = lanes.successor[lanes.successor_start[lane] : lanes.successor_start[lane + 1]]
        equal.append(theirs == set(ours.tolist()))
    assert np.mean(equal) >= 0.99


def test_allowed_lane_changes_are_carlas_where_there_is_a_lane(pair):
    lanes, equal = pair.town.lanes, []
    for waypoint in pair.map.generate_waypoints(5.0):
        lane, s, _ = pair.locate(waypoint)
        change = int(lanes.change[segment_at(lanes, lane, s)[0]])
        for ours, theirs, beside, neighbour in (
            (1, carla.LaneChange.Left, lanes.left[lane], waypoint.get_left_lane()),
            (2, carla.LaneChange.Right, lanes.right[lane], waypoint.get_right_lane()),
        ):
            if beside >= 0 and neighbour is not None:
                equal.append(bool(change & ours) == bool(int(waypoint.lane_change) & int(theirs)))
    assert not equal or np.mean(equal) >= 0.99


def test_junctions_are_carlas(pair):
    lanes = pair.town.lanes
    for waypoint in pair.map.generate_waypoints(10.0):
        lane, _, _ = pair.locate(waypoint)
        ours = lanes.junction[lane]
        assert (ours >= 0) == waypoint.is_junction
        if ours >= 0:
            assert pair.town.junction_names[ours] == str(waypoint.get_junction().id)


@pytest.mark.parametrize("name", ["Town01_2020", "Town04_2020"])
def test_lights_stand_where_carlas_stand(shared, tmp_path, name):
    town = load_town(shared / f"data/xodr/{name}.xodr", cache_folder=tmp_path)
    landmarks = carla.Map(name, town.opendrive).get_all_landmarks()
    theirs = {mark.id: mark.transform for mark in landmarks if mark.type == "1000001"}
    # CARLA puts a light's landmark a quarter of a metre ahead of where the file has it.
    places = np.array(
        [
            (at.location.x - 0.25 * ahead.x, at.location.y - 0.25 * ahead.y)
            for at in theirs.values()
            for ahead in (at.get_forward_vector(),)
        ]
    )
    ours = town.signals.pose[:, :2]
    away = np.hypot(*(ours[:, None] - places[None]).transpose(2, 0, 1))
    assert len(ours) == len(places)
    # And it moves those off the road that stand on it: one in Town04, on a shoulder, by 2.8 m.
    moved = 1 if name == "Town04_2020" else 0
    assert np.count_nonzero(away.min(axis=0) > 0.01) == moved
    assert np.count_nonzero(away.min(axis=1) > 0.01) == moved
    assert away.min(axis=0).max() < 3.0
    assert (town.signals.kind == SignalKind.LIGHT).all()


def test_lights_rule_the_lanes_that_carlas_landmarks_are_on(shared, tmp_path):
    town = load_town(shared / "data/xodr/Town01_2020.xodr", cache_folder=tmp_path)
    lanes, signals = town.lanes, town.signals
    # One light an arm of each T-junction, and every approach lane has a stop line.
    assert set(signals.groups) == {3}
    for lane in np.flatnonzero(lanes.kind == LaneKind.DRIVING):
        ahead = lanes.successor[lanes.successor_start[lane] : lanes.successor_start[lane + 1]]
        approaches = lanes.junction[lane] < 0 and (lanes.junction[ahead] >= 0).any()
        assert (lanes.stop_line[lane] >= 0) == approaches
    # A light stands within a street's width of the stop line that it rules.
    poles = signals.pose[signals.stop_signal, :2]
    assert np.hypot(*(poles - signals.stop_pose[:, :2]).T).max() < 15.0


def test_crosswalks_lie_where_carlas_lie(shared, tmp_path):
    town = load_town(shared / "data/xodr/Town04_2020.xodr", cache_folder=tmp_path)
    rings, ring = [], []
    for point in carla.Map("Town04", town.opendrive).get_crosswalks():
        ring.append((point.x, point.y))
        if len(ring) > 1 and ring[0] == ring[-1]:  # the last closes the ring
            rings.append(np.array(ring[:-1]))
            ring = []
    ends = np.stack([town.crosswalks.start, town.crosswalks.end])[..., :2]
    ours = ends.mean(axis=0)
    assert len(ours) == len(rings)
    for corners in rings:
        away = np.hypot(*(ours - corners.mean(axis=0)).T)
        assert away.min() < (0.01 if len(corners) == 4 else 0.5)
        # Each of our ends lies within a crosswalk's width of one of CARLA's corners.
        for end in ends[:, int(away.argmin())]:
            assert np.hypot(*(corners - end).T).min() < 2.5


def test_the_shipped_towns_are_read_by_carla_without_a_nan(tmp_path):
    for name in ("toy", "town05"):
        town = load_town(name, cache_folder=tmp_path)
        for waypoint in carla.Map(name, town.opendrive).generate_waypoints(5.0):
            place = waypoint.transform.location
            assert math.isfinite(place.x + place.y + place.z + waypoint.transform.rotation.yaw)
            assert waypoint.next(1.0)
