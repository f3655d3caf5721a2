"""Crosswalk outlines become strips over the lanes that they lie on."""

from __future__ import annotations

import math

import numpy as np
import pytest

from di_envs.town.reading.crosswalks import strip_of
from tests.di_envs.town.small_maps import lane, load, opendrive, road, section


def crosswalk(corners: str, s: float = 50.0, heading: float = 0.0, **attributes: str) -> str:
    extra = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return (
        f'<objects><object id="1" type="crosswalk" s="{s}" t="0" zOffset="0" hdg="{heading!r}"'
        f"{extra}><outline>{corners}</outline></object></objects>"
    )


def local(*points: tuple[float, float]) -> str:
    return "".join(f'<cornerLocal u="{u}" v="{v}" z="0"/>' for u, v in (*points, points[0]))


def town_with(text: str, folder):
    return load(opendrive(road("1", 100.0, section(0.0, lane(1), lane(-1)), after=text)), folder)


ACROSS = local((5.0, 1.5), (5.0, -1.5), (-5.0, -1.5), (-5.0, 1.5))  # 10 m along u, 3 m wide


def test_a_crosswalk_across_a_street_lies_on_both_lanes(tmp_path):
    town = town_with(crosswalk(ACROSS, heading=math.pi / 2), tmp_path)
    walks, lanes = town.crosswalks, town.lanes
    ends = sorted([tuple(walks.start[0].round(6)), tuple(walks.end[0].round(6))])
    assert ends == [(50.0, -5.0, 0.0), (50.0, 5.0, 0.0)]
    assert walks.width_m == pytest.approx([3.0])
    assert list(walks.crossed_start) == [0, 2]
    assert sorted(lanes.lane_id[walks.crossed_lane]) == [-1, 1]
    # Points from 48.5 m to 51.5 m lie on it, a quarter of a metre around them counts.
    assert walks.crossed_begin_m == pytest.approx([48.25, 48.25])
    assert walks.crossed_end_m == pytest.approx([51.75, 51.75])


def test_corners_along_the_road_give_the_same(tmp_path):
    corners = "".join(
        f'<cornerRoad s="{s}" t="{t}" dz="0"/>'
        for s, t in ((48.5, 5.0), (51.5, 5.0), (51.5, -5.0), (48.5, -5.0))
    )
    walks = town_with(crosswalk(corners), tmp_path).crosswalks
    assert sorted([walks.start[0, 1], walks.end[0, 1]]) == pytest.approx([-5.0, 5.0])
    assert walks.width_m == pytest.approx([3.0])
    assert len(walks.crossed_lane) == 2


def test_other_objects_are_no_crosswalks(tmp_path):
    text = crosswalk(ACROSS).replace('type="crosswalk"', 'type="tree"')
    assert len(town_with(text, tmp_path).crosswalks.width_m) == 0


def test_an_outline_of_many_corners_is_taken_along_its_longest_way():
    corners = [[-6, -1], [-2, -1], [2, -1], [6, -1], [6, 1], [2, 1], [-2, 1], [-6, 1]]
    start, end, width = strip_of(np.array([[*corner, 0.0] for corner in corners], dtype=float))
    assert sorted([tuple(start), tuple(end)]) == [(-6.0, 0.0, 0.0), (6.0, 0.0, 0.0)]
    assert width == pytest.approx(2.0)


def test_a_skewed_outline_ends_in_the_middles_of_its_short_sides():
    corners = np.array([[0.0, 0, 0], [10, 0, 0], [12, 3, 0], [2, 3, 0]])
    start, end, width = strip_of(corners)
    assert sorted([tuple(start), tuple(end)]) == [(1.0, 1.5, 0.0), (11.0, 1.5, 0.0)]
    assert width == pytest.approx(3.0)  # area 30 over length 10
