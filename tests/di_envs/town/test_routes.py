"""Route files: both layouts, a round trip, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from di_envs.town.routing.routes import (
    Keypoint,
    RouteFileError,
    RouteScenario,
    RouteSpec,
    RouteWeather,
    read_routes,
    write_routes,
)

LEADERBOARD_1 = """<?xml version="1.0" encoding="UTF-8"?>
<routes>
  <route id="16" town="Town05">
    <weather id="Custom" cloudiness="30.0" sun_altitude_angle="70.0"/>
    <waypoint pitch="360.0" roll="0.0" x="-107.15" y="-135.17" yaw="0.44" z="0.055"/>
    <waypoint x="-55.5" y="-107" z="0"/>
  </route>
</routes>"""

LEADERBOARD_2 = """<routes>
  <route id="1" town="Town13">
    <weathers>
      <weather route_percentage="0" cloudiness="5.0"/>
      <weather route_percentage="100" cloudiness="60.0"/>
    </weathers>
    <waypoints><position x="1.0" y="2.0" z="3.0"/><position x="4.0" y="5.0" z="6.0"/></waypoints>
    <scenarios><scenario name="a" type="Accident"><trigger_point x="1" y="2" z="3"/></scenario>
    </scenarios>
  </route>
</routes>"""

TWO_POINTS = '<waypoint x="0" y="0" z="0"/><waypoint x="1" y="0" z="0"/>'


def written(folder: Path, text: str) -> Path:
    path = folder / "routes.xml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_of_leaderboard_1_gives_places_angles_and_weather(tmp_path: Path) -> None:
    (route,) = read_routes(written(tmp_path, LEADERBOARD_1))
    assert (route.route_id, route.town) == ("16", "Town05")
    assert route.keypoints[0] == Keypoint(-107.15, -135.17, 0.055, 360.0, 0.0, 0.44)
    np.testing.assert_array_equal(route.positions[1], [-55.5, -107.0, 0.0])
    (weather,) = route.weathers
    assert weather.name == "Custom"
    assert weather.parameters == {"cloudiness": 30.0, "sun_altitude_angle": 70.0}


def test_a_file_of_leaderboard_2_gives_positions_and_weathers_along_the_route(
    tmp_path: Path,
) -> None:
    (route,) = read_routes(written(tmp_path, LEADERBOARD_2))
    np.testing.assert_array_equal(route.positions, [[1, 2, 3], [4, 5, 6]])
    assert [weather.parameters["route_percentage"] for weather in route.weathers] == [0.0, 100.0]
    assert route.scenarios == (RouteScenario("a", "Accident", 1.0, 2.0, 3.0, 0.0),)


coordinates = st.floats(-1e6, 1e6)
keypoints = st.builds(Keypoint, *[coordinates] * 6)
specs = st.builds(
    RouteSpec,
    route_id=st.just("a"),
    town=st.just("Town05"),
    keypoints=st.lists(keypoints, min_size=2, max_size=4).map(tuple),
    weathers=st.lists(
        st.builds(
            RouteWeather,
            name=st.sampled_from(["", "ClearNoon"]),
            parameters=st.dictionaries(st.sampled_from(["cloudiness", "wetness"]), coordinates),
        ),
        max_size=2,
    ).map(tuple),
    scenarios=st.lists(
        st.builds(
            RouteScenario,
            st.sampled_from(["", "ControlLoss_1"]),
            st.sampled_from(["ControlLoss", "ParkingExit"]),
            *[coordinates] * 4,
        ),
        max_size=2,
    ).map(tuple),
)


@given(spec=specs)
def test_what_is_written_is_read_back_unchanged(
    tmp_path_factory: pytest.TempPathFactory, spec: RouteSpec
) -> None:
    path = tmp_path_factory.mktemp("routes") / "routes.xml"
    write_routes(path, [spec])
    assert read_routes(path) == [spec]


def test_the_layout_of_leaderboard_2_keeps_places_and_loses_angles(tmp_path: Path) -> None:
    spec = RouteSpec(
        route_id="0", town="T", keypoints=(Keypoint(1, 2, 3, 4, 5, 6), Keypoint(7, 8, 9))
    )
    write_routes(tmp_path / "routes.xml", [spec], layout="2.x")
    (back,) = read_routes(tmp_path / "routes.xml")
    assert back.keypoints == (Keypoint(1, 2, 3), Keypoint(7, 8, 9))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not well-formed"),
        ("<routes><route", "not well-formed"),
        ("<routes></routes>", "expected <route> elements"),
        (f'<routes><route id="1">{TWO_POINTS}</route></routes>', "expected <route id=… town=…>"),
        ('<routes><route id="1" town="T"/></routes>', "route '1' has 0 keypoints"),
        (
            f'<routes><route id="1" town="T">{TWO_POINTS.replace("1", "nan")}</route></routes>',
            "finite number for 'x' of <waypoint>, got 'nan'",
        ),
        (
            f'<routes><route id="1" town="T"><weather wetness="w"/>{TWO_POINTS}</route></routes>',
            "finite number for 'wetness' of <weather>, got 'w'",
        ),
        (
            f'<routes><route id="1" town="T"><scenario type="A"/>{TWO_POINTS}</route></routes>',
            "expected <scenario name=… type=…><trigger_point",
        ),
        (
            f'<routes><route id="1" town="T">{TWO_POINTS.replace("z=", "w=")}</route></routes>',
            "finite number for 'z' of <waypoint>, got None",
        ),
        (
            "<routes>" + f'<route id="1" town="T">{TWO_POINTS}</route>' * 2 + "</routes>",
            "two routes have the id '1'",
        ),
    ],
)
def test_a_broken_file_is_refused_with_the_reason(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(RouteFileError, match=message):
        read_routes(written(tmp_path, text))


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RouteFileError, match="no such route file"):
        read_routes(tmp_path / "none.xml")
    with pytest.raises(RouteFileError, match="cannot be read"):
        read_routes(tmp_path)


def test_nothing_or_one_id_twice_is_not_written(tmp_path: Path) -> None:
    spec = RouteSpec(route_id="0", town="T", keypoints=(Keypoint(0, 0, 0), Keypoint(1, 0, 0)))
    for routes in ([], [spec, spec]):
        with pytest.raises(RouteFileError, match="different id"):
            write_routes(tmp_path / "routes.xml", routes)


def test_the_official_files_hold_ten_long_and_thirty_two_short_routes(shared: Path) -> None:
    long = read_routes(shared / "data/routes/routes_town05_long.xml")
    short = read_routes(shared / "data/routes/routes_town05_short.xml")
    assert [route.route_id for route in long] == [str(i) for i in range(16, 26)]
    assert len(short) == 32
    # every short route joins two points 50 m apart in x and in y
    spans = [np.abs(np.diff(route.positions[:, :2], axis=0)) for route in short]
    assert max(np.abs(span - 50.0).max() for span in spans) < 0.01
    assert math.isclose(long[0].keypoints[0].yaw_deg, 0.4425617456436157)
