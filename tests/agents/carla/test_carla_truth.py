"""The true world as CARLA's provider tells it: whom, what, and what it says that it lacks."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest

from agents import load_agent
from agents.base import Track
from agents.carla import data_provider
from agents.carla.data_provider import CarlaDataProvider, GameTime, NoTruthError
from agents.carla.true_map import TrueMap, Waypoint
from agents.carla.values import carla_values
from agents.navigation.global_route_planner import GlobalRoutePlanner, NoWayError, RoadOption
from agents.navigation.local_planner import LocalPlanner
from di_envs.route_env import RouteEnv
from di_envs.town.lanes import LaneKind
from di_envs.town.loading import load_town
from leaderboard.autoagents.autonomous_agent import AutonomousAgent
from leaderboard.running.driver import Driver
from leaderboard.running.jobs import Job, RunSpec

QUIET = {"suite": "toy", "traffic": 3, "walkers": 2, "route_ids": ("1",)}
FOLLOWS = """
import carla
from agents.navigation.{module} import {driver}
from leaderboard.autoagents.autonomous_agent import AutonomousAgent, Track
from srunner.scenariomanager.carla_data_provider import CarlaDataProvider
from srunner.scenariomanager.timer import GameTime


def get_entry_point():
    return "Follows"


class Follows(AutonomousAgent):
    driver = None

    def setup(self, config):
        self.track = Track.SENSORS

    def sensors(self):
        return []

    def run_step(self, data, timestamp):
        assert abs(GameTime.get_time() - timestamp) < 1e-9
        if self.driver is None:
            hero = next(
                actor
                for actor in CarlaDataProvider.get_world().get_actors()
                if actor.attributes.get("role_name") == "hero"
            )
            self.driver, plan, last = {driver}(hero), [], None
            for place, _ in self._global_plan_world_coord:
                here = CarlaDataProvider.get_map().get_waypoint(place.location)
                plan += [] if last is None else self.driver.trace_route(last, here)
                last = here
            self.driver.set_global_plan(plan)
            return carla.VehicleControl()
        return self.driver.run_step()
"""


@pytest.fixture(scope="module")
def env():
    env = RouteEnv(observations=("inertial",), control_dt_s=0.05, **QUIET)
    env.reset(seed=3)
    return env


@pytest.fixture
def told(env):
    """The provider, while it is shown a world."""
    data_provider.show(env.view)
    yield CarlaDataProvider
    data_provider.show(None)


def written(tmp_path, module="basic_agent", driver="BasicAgent"):
    path = tmp_path / f"{module}_follower.py"
    path.write_text(FOLLOWS.format(module=module, driver=driver))
    return f"carla:{path}"


@pytest.mark.parametrize(
    ("module", "driver"), [("basic_agent", "BasicAgent"), ("behavior_agent", "BehaviorAgent")]
)
def test_a_privileged_autopilot_drives_a_route_by_carlas_planners(module, driver, tmp_path):
    spec = written(tmp_path, module, driver) + "?track=PRIVILEGED"
    assert load_agent(spec).requires.track is Track.PRIVILEGED
    with Driver(RunSpec(agent=spec, options={**QUIET, "traffic": 0})) as driver_:
        assert driver_.requires.track is Track.PRIVILEGED
        record = driver_.drive(Job(index=0, route_id="1", seed=0))
    assert record.score.route_completion >= 90.0


def test_an_agent_that_may_not_know_the_truth_is_told_how_to_ask_for_it(tmp_path):
    with Driver(RunSpec(agent=written(tmp_path), options=QUIET)) as driver:
        assert driver.requires.track is Track.SENSORS
        record = driver.drive(Job(index=0, route_id="1", seed=0))
    assert "carla:FILE?track=PRIVILEGED" in record.reason
    assert record.steps == 0
    with pytest.raises(NoTruthError):
        CarlaDataProvider.get_hero_actor()


def test_the_hero_is_where_the_world_has_it(told, env):
    hero, state = told.get_hero_actor(), env.view.state
    place = hero.get_transform()
    assert place.location.x == pytest.approx(state.x[0], abs=1e-3)
    assert math.cos(math.radians(place.rotation.yaw) - state.yaw[0]) == pytest.approx(1.0)
    assert hero.attributes["role_name"] == "hero"
    assert told.get_velocity(hero) == pytest.approx(abs(state.speed[0]))
    assert hero.bounding_box.extent.x == pytest.approx(state.half_length[0])
    assert hero.get_speed_limit() == pytest.approx(
        3.6 * env.view.town.lanes.speed_limit_mps[state.lane[0]]
    )
    kinds = [actor.type_id.partition(".")[0] for actor in told.get_all_actors()]
    assert (kinds.count("vehicle"), kinds.count("walker")) == (4, 2)
    assert len(told.get_world().get_actors().filter("*vehicle*")) == 4
    assert told.get_world().get_actor(hero.id) == hero


def test_signals_tell_what_they_show_and_where_to_stop(told, env):
    signs = told.get_world().get_actors().filter("traffic.*")
    town = env.view.town
    assert len(signs) == len(town.signals.kind)
    for sign in signs:
        for stop in sign.get_stop_waypoints():
            assert not stop.is_junction
            assert all(beyond.is_junction for beyond in stop.next(3.0))


def test_a_waypoint_is_on_its_lane_and_goes_on_from_it(env):
    town_map, lanes, carla = TrueMap(env.view.town), env.view.town.lanes, carla_values()
    lane = int(env.plan.lane[0])
    x, y, z, yaw = lanes.points[lanes.first[lane] + 4].tolist()
    beside = carla.Location(x=x - math.sin(yaw), y=y + math.cos(yaw), z=z)  # 1 m to the right
    here = town_map.get_waypoint(beside)
    assert here.transform.location.distance(carla.Location(x=x, y=y, z=z)) < 0.02
    assert here.lane_width == pytest.approx(lanes.width_m[lanes.first[lane] + 4], abs=0.05)
    (there,) = here.next(3.0)
    assert there.transform.location.distance(here.transform.location) == pytest.approx(3.0, abs=0.1)
    (back,) = there.previous(3.0)
    assert back.transform.location.distance(here.transform.location) < 0.01
    assert town_map.get_waypoint(beside, lane_type=carla.LaneType.Sidewalk) != here
    far = carla.Location(x=x + 5000.0, y=y, z=z)
    assert town_map.get_waypoint(far) is None


def test_the_planner_finds_the_route_and_names_its_turns(env):
    """Between its first point and its last the router's own route is the shortest way."""
    plan, carla = env.plan, carla_values()
    planner = GlobalRoutePlanner(TrueMap(env.view.town), 2.0)
    ends = [carla.Location(*map(float, plan.points[i, :3])) for i in (0, -1)]
    way = planner.trace_route(*ends)
    places = np.array([(w.transform.location.x, w.transform.location.y) for w, _ in way])
    apart = np.hypot(*(places[:, None] - plan.points[None, :, :2]).transpose(2, 0, 1))
    assert apart.min(axis=1).max() < 1.5
    assert {option for _, option in way} == {RoadOption(int(o)) for o in set(plan.option.tolist())}
    with pytest.raises(NoWayError, match="no lane is near"):
        planner.trace_route(ends[0], carla.Location(x=9000.0, y=0.0, z=0.0))


def test_every_place_just_ahead_is_reached_by_no_detour_also_at_the_ends_of_lanes(env):
    """From each lane's end over a bound of lanes: steps of 2 m meet few places exactly."""
    town_map = TrueMap(env.view.town)
    lanes, planner = env.view.town.lanes, GlobalRoutePlanner(town_map, 2.0)
    for lane in np.flatnonzero((lanes.kind == LaneKind.DRIVING) & (lanes.junction < 0))[
        :6
    ].tolist():
        length_m = float(lanes.length_m[lane])
        for back_m, ahead_m in ((27.0, 26.9), (9.3, 9.3), (6.5, 0.4), (0.1, 0.0)):
            start = Waypoint(town_map, lane, max(length_m - back_m, 0.0))
            goal = start.next(min(ahead_m, length_m))[0]
            way = planner.trace_route(start.transform.location, goal.transform.location)
            places = [waypoint.transform.location for waypoint, _ in way]
            far_m = sum(map(carla_values().Location.distance, places, places[1:]))
            assert far_m <= ahead_m + 2.1
            assert places[-1].distance(goal.transform.location) < 1.0


def test_who_must_be_on_the_next_lane_in_a_few_metres_changes_to_it_at_once():
    """Where a lane change begins and ends, the thinned route has a point on each lane."""
    town = load_town("town05")
    town_map, lanes = TrueMap(town), town.lanes
    side = lanes.change[lanes.first] & 2 != 0
    lane = int(np.flatnonzero(side & (lanes.right >= 0) & (lanes.length_m > 40.0))[0])
    start = Waypoint(town_map, lane, 20.0)
    goal = start.get_right_lane().next(5.0)[0]
    planner = GlobalRoutePlanner(town_map, 2.0)
    way = planner.trace_route(start.transform.location, goal.transform.location)
    assert way[-1] == (goal, RoadOption.CHANGELANERIGHT)
    assert len(way) == 2


def test_without_a_plan_the_local_planner_drives_straight_on(told):
    planner = LocalPlanner(told.get_hero_actor(), {"target_speed": 30})
    control = planner.run_step()
    assert control.throttle > 0.3
    assert abs(control.steer) < 0.5
    assert not planner.done()


def test_metric_info_is_the_truth_for_privileged_agents_and_nan_for_others(told):
    class Mine(AutonomousAgent):
        pass

    info = Mine("config").get_metric_info()
    assert info["location"][0] == pytest.approx(told.get_hero_actor().get_location().x)
    ahead, right = info["forward_vector"], info["right_vector"]
    assert (ahead[0], ahead[1]) == pytest.approx((right[1], -right[0]), abs=1e-5)
    data_provider.show(None)
    blank = np.array(list(Mine("config").get_metric_info().values()))
    assert (blank.shape, np.isnan(blank).all()) == ((6, 3), True)


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (
            lambda p: p.get_world().spawn_actor(),
            r"TrueWorld has no spawn_actor.*known: .*get_actor",
        ),
        (lambda p: p.get_client(), "CarlaDataProvider has no get_client"),
        (lambda p: p.get_hero_actor().set_autopilot(True), "Body has no set_autopilot"),
        (lambda p: p.get_map().get_topologi(), "TrueMap has no get_topologi"),
    ],
)
def test_what_is_not_there_says_so_with_the_nearest_that_is(told, ask, says):
    with pytest.raises(AttributeError, match=says):
        ask(told)


def test_no_clock_runs():
    GameTime.show(40)
    assert (GameTime.get_time(), GameTime.get_frame()) == (2.0, 40)
    assert GameTime.get_wallclocktime().isoformat() == "2000-01-01T00:00:02+00:00"


def test_without_the_wheel_an_agent_imports_carlas_plain_values(tmp_path):
    code = """
import sys
sys.modules["carla"] = None
from agents import load_agent
agent = load_agent(sys.argv[1])
import carla
control = carla.VehicleControl(throttle=0.5)
print(control.throttle, carla.Location(x=3.0).distance(carla.Location(y=4.0)))
try:
    carla.Client
except AttributeError as error:
    print(error)
"""
    found = subprocess.run(
        [sys.executable, "-c", code, written(tmp_path)], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    assert found[0] == "0.5 5.0"
    assert "carla.Client is not here: CARLA's wheel is not installed" in found[1]
