"""Route files of other people: each fault is named, and stops no route but its own."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path

import gymnasium
import pytest

import di_envs  # noqa: F401 (registers the ids)
from di_envs.course import load_course
from di_envs.planned_routes import PlannedRoutes
from di_envs.route_env import RouteEnv
from di_envs.suites import choose_suite, load_suite, suite_names
from di_envs.town.loading import load_town
from di_envs.town.routing.remarks import RouteWarning
from di_envs.town.routing.router import RouteError
from di_envs.town.routing.routes import RouteFileError
from di_envs.traffic_level import TrafficLevel, driving_lanes_m, usual_traffic

# Street 11's southern side leads east at y = 55.25
STREET = '<waypoint x="-60" y="55.25" z="0"/><waypoint x="-20" y="55.25" z="0"/>'
FAR = '<waypoint x="1000" y="1000" z="0"/><waypoint x="-20" y="55.25" z="0"/>'
HIGH = '<waypoint x="-60" y="55.25" z="{}"/><waypoint x="-20" y="55.25" z="0"/>'


def route(route_id: str, points: str = STREET, town: str = "Toy", more: str = "") -> str:
    return f'<route id="{route_id}" town="{town}">{more}{points}</route>'


def written(folder: Path, routes: Iterable[str]) -> Path:
    path = folder / "mine.xml"
    path.write_text(f"<routes>{''.join(routes)}</routes>", encoding="utf-8")
    return path


def planned(folder: Path, *routes: str, town: str = "toy", strict: bool = False) -> PlannedRoutes:
    suite = choose_suite(town=town, routes=written(folder, routes))
    return suite.planned(load_town(suite.town_path), strict=strict)


def quietly(folder: Path, *routes: str, town: str = "toy") -> tuple[PlannedRoutes, list[str]]:
    """What is planned, and what is warned about."""
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        found = planned(folder, *routes, town=town)
    assert all(warning.category is RouteWarning for warning in heard)
    return found, [str(warning.message) for warning in heard]


def ids(found: PlannedRoutes) -> list[str]:
    return [plan.route_id for plan in found.plans]


# ---- what is odd


def test_a_file_with_odd_routes_is_warned_about_once_the_worst_first(tmp_path: Path) -> None:
    odd = [route(f"r{z}", HIGH.format(z)) for z in (6, 9, 12, 8, 7)]
    found, (heard,) = quietly(tmp_path, *odd, route("sound"))
    assert len(ids(found)) == 6
    head, *lines, rest = heard.splitlines()
    assert head == "mine.xml: 5 of 6 routes look odd, and are driven as they are:"
    assert [line.split("'")[1] for line in lines] == ["r12", "r9", "r8"]
    assert "keypoint 0 at (-60.0, 55.2, 12.0) lies 12.0 m from its lane" in lines[0]
    assert rest == "less so: r7, r6"


@pytest.mark.parametrize("name", suite_names())
def test_there_is_nothing_to_say_of_the_shipped_suites(name: str) -> None:
    suite = load_suite(name)
    found = suite.planned(load_town(suite.town_path))
    assert (dict(found.refused), found.warnings, found.notes) == ({}, (), ())


# ---- what cannot be planned


def test_a_route_that_cannot_be_planned_is_left_out_by_name_and_the_others_stay(
    tmp_path: Path,
) -> None:
    one_point = STREET.partition("/>")[0] + "/>"
    no_number = STREET.replace("-20", "nan")
    found, (heard,) = quietly(
        tmp_path, route("a"), route("far", FAR), route("one", one_point), route("nan", no_number)
    )
    assert ids(found) == ["a"]
    assert set(found.refused) == {"far", "one", "nan"}
    assert "1311.7 m from the nearest driving lane" in found.refused["far"]
    assert "route 'one' has 1 keypoints" in found.refused["one"]
    assert "finite number for 'x' of <waypoint>, got 'nan'" in found.refused["nan"]
    assert heard.startswith("mine.xml: 3 of 4 routes cannot be planned and are left out:\n")


def test_strict_refuses_the_file_for_one_route(tmp_path: Path) -> None:
    with pytest.raises(RouteError, match="Route 'far': keypoint 0"):
        planned(tmp_path, route("a"), route("far", FAR), strict=True)
    with pytest.raises(RouteError, match="route 'one' has 0 keypoints"):
        planned(tmp_path, route("a"), route("one", ""), strict=True)
    with pytest.raises(ValueError, match="Route 'far': keypoint 0"):
        RouteEnv(
            town="toy",
            routes=str(written(tmp_path, [route("a"), route("far", FAR)])),
            strict=True,
        )


def test_a_file_of_which_nothing_can_be_planned_is_refused_with_reasons(tmp_path: Path) -> None:
    with pytest.raises(RouteError, match=r"(?s)no route can be planned.*'f'.*'g'"):
        planned(tmp_path, route("f", FAR), route("g", FAR))


def test_an_environment_leaves_refused_routes_out_and_says_why_where_one_is_asked_for(
    tmp_path: Path,
) -> None:
    path = str(written(tmp_path, [route("a"), route("far", FAR)]))
    options = {"town": "toy", "routes": path, "suite": None, "traffic": 0, "walkers": 0}
    with pytest.warns(RouteWarning, match="1 of 2 routes cannot be planned"):
        env = gymnasium.make("DriveInsight-Toy-v1", observations=("prompt",), **options)
    assert env.unwrapped.route_ids == ("a",)  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match=r"Route 'far': keypoint 0 .* is 1311\.7 m from"):
        env.reset(options={"route": "far"})
    env.close()


# ---- whose town


def test_routes_of_other_towns_are_left_out_aloud(tmp_path: Path) -> None:
    others = [route("b", town="Town01"), route("c", town="Town02"), route("d", town="Town01")]
    found, heard = quietly(tmp_path, route("a", town="TOY"), *others)
    assert ids(found) == ["a"]
    assert heard == [
        "mine.xml: 1 of 4 routes are of toy; left out: 2 of Town01, 1 of Town02.",
    ]
    suite = choose_suite(town="toy", routes=tmp_path / "mine.xml")
    with pytest.raises(ValueError, match=r"Route 'c' of mine\.xml is in Town02; choose that town"):
        suite.specs("toy", ["c"])


def test_a_file_for_several_towns_and_not_for_this_one_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RouteFileError, match="no route is in town 'toy'; its towns: Town01, T2"):
        planned(tmp_path, route("a", town="Town01"), route("b", town="T2"))


def test_a_file_written_for_one_other_town_is_driven_with_a_warning_if_it_fits(
    tmp_path: Path,
) -> None:
    found, heard = quietly(tmp_path, route("a", town="Town01"))
    assert ids(found) == ["a"]
    assert heard == [
        "mine.xml was written for Town01, not for toy; 0 of its 2 keypoints lie over 10 m from "
        "every lane here."
    ]
    # the toy town's middle of street 11, 40 m south of it: both keypoints off every lane
    beside = STREET.replace("55.25", "20")
    with pytest.raises(RouteFileError, match="written for Town01, and 2 of its 2 keypoints lie"):
        planned(tmp_path, route("a", beside, town="Town01"))


# ---- scenarios of 2.x

PLACED = (
    '<scenarios><scenario name="1" type="{}">'
    '<trigger_point x="-50" y="55.25" z="0" yaw="0"/></scenario></scenarios>'
)


def test_scenarios_in_the_route_file_are_met_and_what_is_left_out_is_counted(
    tmp_path: Path,
) -> None:
    found = planned(
        tmp_path,
        route("a", more=PLACED.format("ControlLoss")),
        route("b", more=PLACED.format("DynamicObjectCrossing")),
        route("c", more=PLACED.format("ParkingExit")),
        route("d", more=PLACED.format("ParkingExit")),
        route("e", more=PLACED.format("Accident")),
        route("f", more=PLACED.format("SignalizedJunctionLeftTurn")),  # it goes straight on
    )
    met = [[(trigger.type, trigger.point) for trigger in plan.scenarios] for plan in found.plans]
    assert met == [[(1, 10)], [(3, 10)], [], [], [], []]
    assert found.notes == (
        "Scenarios in the route file: 6, of which routes meet 2.",
        "Not met: 1; their route stays away, turns otherwise, has another there.",
        "Left out, as such types are not staged here: 1 Accident, 2 ParkingExit.",
    )


def test_none_drives_without_the_scenarios_in_the_route_file(tmp_path: Path) -> None:
    path = written(tmp_path, [route("a", more=PLACED.format("ControlLoss"))])
    suite = choose_suite(town="toy", routes=path, scenarios="none")
    found = suite.planned(load_town("toy"))
    assert found.plans[0].scenarios == ()
    assert found.notes == (
        "Scenarios in the route file, left out as --scenarios says otherwise: 1.",
    )


# ---- how many others


def test_the_density_is_that_of_the_shipped_town05() -> None:
    lanes = load_town("town05").lanes
    assert driving_lanes_m(lanes) == pytest.approx(17_798.0, abs=1.0)
    assert usual_traffic(lanes) == TrafficLevel(vehicles=120, walkers=60)


def test_on_a_map_of_ones_own_traffic_goes_by_lane_length_and_the_run_says_so(
    tmp_path: Path,
) -> None:
    """2.163 km of 17.798: 14.6 of 120 vehicles, 7.3 of 60 walkers."""
    path = str(written(tmp_path, [route("a")]))
    course = load_course({"town": "toy", "routes": path, "observations": ("prompt",)})
    assert (course.config.traffic, course.config.walkers) == (15, 7)
    (note,) = course.planned.notes
    assert "2.2 km" in note
    assert note.endswith(": 15 vehicles and 7 walkers.")
    given = load_course({"town": "toy", "routes": path, "traffic": 3, "walkers": 0})
    assert (given.config.traffic, given.planned.notes) == (3, ())
    assert load_course({"suite": "toy"}).config.traffic == 12
    assert load_course({"suite": "toy", "routes": path}).config.traffic == 12
