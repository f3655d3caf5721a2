"""Agents of the CARLA Leaderboard behind our contract: calls, clocks, seeds, what goes wrong."""

from __future__ import annotations

import io
import json
import sys
import textwrap
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from agents import AgentSpecError, load_agent
from agents.base import Requirements, Track
from agents.carla.agent import control_of
from agents.carla.formats import with_origin
from agents.processes import births
from di_envs.route_env import RouteEnv
from di_envs.suites import load_suite
from leaderboard.records.record import AGENT_CRASHED, NOT_SET_UP, SENSORS_INVALID
from leaderboard.records.results import read_run
from leaderboard.running.driver import Driver, environment_options
from leaderboard.running.jobs import Job, RunSpec
from leaderboard.running.runner import evaluate
from tests.carla_wheel import carla_wheel

QUIET = {"suite": "toy", "traffic": 0, "walkers": 0, "route_ids": ("1",)}

BODY = """
import json
import random
from types import SimpleNamespace

import numpy as np

from leaderboard.autoagents import autonomous_agent
from leaderboard.autoagents.autonomous_agent import AutonomousAgent, Track

LEVEL = {"x": 0.0, "y": 0.0, "z": 2.0, "roll": 0.0, "pitch": 0.0, "yaw": 0.0}


def get_entry_point():
    return "Mine"


class Mine(AutonomousAgent):
    CALLS = []

    def setup(self, config):
        self.track = Track.SENSORS
        self.config = config
        self.CALLS.append(("setup", config, self._global_plan is not None))

    def sensors(self):
        self.CALLS.append(("sensors",))
        return [
            dict(LEVEL, type="sensor.camera.rgb", id="eye", width=32, height=16, fov=90),
            {"type": "sensor.other.gnss", "id": "gps", "x": 0.0, "y": 0.0, "z": 0.0},
            {"type": "sensor.speedometer", "id": "speed", "reading_frequency": 20},
        ]

    def set_global_plan(self, gps, world):
        self.CALLS.append(("plan", len(gps) == len(world)))
        super().set_global_plan(gps, world)

    def run_step(self, input_data, timestamp):
        frames = {frame for frame, _ in input_data.values()}
        self.CALLS.append(("step", sorted(input_data), frames, timestamp))
        return SimpleNamespace(throttle=0.3, steer=0.0, brake=0.0)

    def destroy(self):
        self.CALLS.append(("destroy",))
"""


def written(tmp_path, changes="", name="mine.py"):
    """The agent above in a file, with lines of its class put in place of some."""
    path = tmp_path / name
    path.write_text(BODY + textwrap.indent(textwrap.dedent(changes), "    "))
    return f"carla:{path}"


def stepped(spec, steps=3):
    """The adapter and the foreign agent's calls, after a few steps in an environment of its own."""
    agent = load_agent(spec)
    calls = agent._class.CALLS
    env = RouteEnv(**environment_options(QUIET, agent.requires))
    probed = list(calls)
    calls.clear()
    observation, _ = env.reset(seed=1)
    memory = agent.start(env.plan, 1)
    for _ in range(steps):
        control, memory = agent.act(observation, memory)
        observation, *_ = env.step(control)
    agent.close()
    return agent, probed, calls


def test_leaderboard_one_sets_up_in_the_constructor_and_then_tells_the_route(tmp_path):
    agent, probed, calls = stepped(written(tmp_path) + "?config=weights.pth")
    assert probed == [("setup", "weights.pth", False), ("sensors",), ("destroy",)]
    steps = [("step", ["eye", "gps", "speed"], {n}, pytest.approx(0.05 * n)) for n in (1, 2, 3)]
    assert calls == [
        ("setup", "weights.pth", False),
        ("sensors",),
        ("plan", True),
        *steps,
        ("destroy",),
    ]
    assert agent.requires.control_dt_s == 0.05
    assert agent.requires.observations == ("camera", "inertial")
    assert agent.requires.track is Track.SENSORS
    assert not agent.requires.branchable


def test_leaderboard_two_tells_the_route_and_then_sets_up(tmp_path):
    agent, _, calls = stepped(written(tmp_path) + "?leaderboard=2.1&config=a.yaml")
    assert [call[0] for call in calls] == ["plan", "setup", "sensors", *["step"] * 3, "destroy"]
    assert calls[1] == ("setup", "a.yaml", True)
    assert agent._leaderboard == "2.1"


def test_a_constructor_with_host_and_port_is_that_of_leaderboard_two(tmp_path):
    own = """
    def __init__(self, carla_host, carla_port, debug=False):
        super().__init__(carla_host, carla_port, debug)
        self.CALLS.append(("made", carla_host, carla_port, debug))
    """
    _, _, calls = stepped(written(tmp_path, own))
    assert [call[0] for call in calls[:3]] == ["made", "plan", "setup"]
    assert calls[0] == ("made", "localhost", 2000, False)


def test_a_constructor_with_a_path_is_that_of_leaderboard_one(tmp_path):
    own = """
    def __init__(self, path_to_conf_file, route_index=None):
        super().__init__(path_to_conf_file)
    """
    _, _, calls = stepped(written(tmp_path, own))
    assert [call[0] for call in calls[:3]] == ["setup", "sensors", "plan"]


def test_the_map_is_handed_to_agents_of_its_track(tmp_path):
    own = """
    def setup(self, config):
        self.track = autonomous_agent.Track.MAP

    def sensors(self):
        return [{"type": "sensor.opendrive_map", "id": "hd", "reading_frequency": 1}]

    def run_step(self, input_data, timestamp):
        self.CALLS.append(input_data["hd"][1]["opendrive"])
        return SimpleNamespace(throttle=0.9, steer=0.0, brake=0.0)
    """
    spec = written(tmp_path, own)
    assert load_agent(spec).requires.track is Track.MAP
    apart = RunSpec(agent=spec, options=QUIET)
    with Driver(replace(apart, isolate=False)) as driver:
        record = driver.drive(Job(index=0, route_id="1", seed=0))
        town = driver.env.view.town
        calls = load_agent(spec)._class.CALLS
    assert record.steps > 10
    assert calls[-2] == with_origin(town.opendrive, (0.0, 0.0))  # the last call is destroy()
    assert "+lat_0=0 +lon_0=0 " in calls[-2]
    with Driver(apart) as driver:
        again = driver.drive(Job(index=0, route_id="1", seed=0))
    assert again.fingerprint() == record.fingerprint()


def test_hidden_generators_begin_anew_with_each_route(tmp_path):
    """One that steers by `random` and `numpy.random` drives alike, whatever it drove before."""
    own = """
    def run_step(self, input_data, timestamp):
        steer = 0.5 * random.uniform(-1, 1) + 0.5 * np.random.uniform(-1, 1)
        return SimpleNamespace(throttle=0.6, steer=steer, brake=0.0)
    """
    jobs = [Job(index=n, route_id="1", seed=n) for n in (0, 1)]
    spec = RunSpec(agent=written(tmp_path, own), options=QUIET)
    with Driver(spec) as driver:
        first, second = (driver.drive(job).fingerprint() for job in jobs)
        assert driver.drive(jobs[0]).fingerprint() == first
    with Driver(spec) as driver:
        assert driver.drive(jobs[1]).fingerprint() == second
    assert dict(first)["reward_hash"] != dict(second)["reward_hash"]


@pytest.mark.parametrize(
    ("changes", "status", "reason"),
    [
        ("def setup(self, c): raise OSError('no weights')", NOT_SET_UP, "OSError: no weights at "),
        ("def sensors(self): return [{'type': 'lidar', 'id': 'a'}]", SENSORS_INVALID, "'a': unkn"),
        ("def sensors(self): raise KeyError('x')", SENSORS_INVALID, "sensors() raised KeyError"),
        ("def __init__(self, config): pass", NOT_SET_UP, "must call super().__init__"),
        ("def setup(self, c): self.track = 'FAST'", SENSORS_INVALID, "Unknown track 'FAST'"),
    ],
)
def test_who_cannot_be_set_up_fails_every_route_and_the_run_goes_on(
    changes, status, reason, tmp_path
):
    spec = RunSpec(agent=written(tmp_path, changes), options=QUIET)
    with pytest.warns(UserWarning, match="cannot be set up without a route"):
        driver = Driver(spec)
    with driver:
        for seed in (0, 1):
            record = driver.drive(Job(index=0, route_id="1", seed=seed))
            assert record.status == status
            assert reason in record.reason
            assert record.steps == 0


@pytest.mark.parametrize(
    ("returned", "reason"),
    [
        ("None", "run_step returned None; expected a carla.VehicleControl"),
        ("SimpleNamespace(throttle=float('nan'), steer=0.0, brake=0.0)", "NaN"),
        ("SimpleNamespace(throttle=0.5)", "with numbers throttle, steer and brake"),
        ("1 / 0", "ZeroDivisionError"),
    ],
)
def test_what_is_no_control_is_a_crash_of_the_agent(returned, reason, tmp_path):
    changes = f"def run_step(self, data, timestamp):\n    return {returned}"
    with Driver(RunSpec(agent=written(tmp_path, changes), options=QUIET)) as driver:
        record = driver.drive(Job(index=0, route_id="1", seed=0))
    assert record.status == AGENT_CRASHED
    assert reason in record.reason


def test_sensors_that_change_after_the_first_setup_are_refused(tmp_path):
    own = """
    def sensors(self):
        self.CALLS.append(1)
        return [{"type": "sensor.camera.rgb", "id": f"eye{len(self.CALLS)}", "width": 32}
                | {"height": 16, "fov": 90, **LEVEL}]
    """
    with Driver(RunSpec(agent=written(tmp_path, own), options=QUIET)) as driver:
        record = driver.drive(Job(index=0, route_id="1", seed=0))
    assert record.status == SENSORS_INVALID
    assert "must be the same for every route" in record.reason


def test_controls_are_any_object_with_the_fields_and_are_clipped():
    control = SimpleNamespace(throttle=2, steer=-3, brake=0.25, hand_brake=False)
    assert control_of(control).tolist() == [1.0, -1.0, 0.25]
    control.hand_brake = True
    assert control_of(control).tolist() == [0.0, -1.0, 1.0]
    backwards = SimpleNamespace(throttle=1.0, steer=0.5, brake=0.0, reverse=True)
    with pytest.warns(UserWarning, match="reverse gear"):
        assert control_of(backwards).tolist() == [0.0, 0.5, 1.0]


def test_carlas_own_controls_are_taken():
    carla = carla_wheel()
    control = carla.VehicleControl(throttle=0.5, steer=-0.25, brake=0.0)
    np.testing.assert_array_equal(control_of(control), np.float32([0.5, -0.25, 0.0]))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("import carla_without_end", "imports what is not here: No module named 'carla_without"),
        ("import srunner.scenarios.basic_scenario", "Of CARLA's ScenarioRunner there is scenariom"),
        ("import leaderboard.utils.checkpoint_tools", "Of CARLA's Leaderboard there is autoagents"),
        ("class Mine: pass", r"no get_entry_point\(\)"),
        ("def get_entry_point(): return 'Mine'", "returned 'Mine', which is no class"),
    ],
)
def test_a_file_that_is_no_agent_says_what_is_missing(text, says, tmp_path):
    path = tmp_path / "none.py"
    path.write_text(text)
    with pytest.raises(AgentSpecError, match=says):
        load_agent(f"carla:{path}")


@pytest.mark.parametrize(
    ("query", "says"),
    [
        ("?leaderbord=2.1", "no option 'leaderbord'; did you mean 'leaderboard'"),
        ("?leaderboard=3", r"Unknown leaderboard '3'; .*known: 1\.0, 2\.0, 2\.1"),
        ("?config", "expected option=value"),
        ("?file=other.py", "the file stands before the '.', not behind it"),
        ("?origin=here", "A map's origin is its latitude"),
        ("?limits=strict", "Unknown limits 'strict'"),
    ],
)
def test_a_wrong_option_is_refused(query, says, tmp_path):
    with pytest.raises(AgentSpecError, match=says):
        load_agent(written(tmp_path) + query)


def test_an_agent_may_say_names_that_numpy_has_dropped(tmp_path):
    """`numpy.int` went with 1.24; InterFuser draws its map by it."""
    body = """
    def run_step(self, input_data, timestamp):
        import numpy
        rounded = numpy.array([0.9]).astype(numpy.int)[0] + numpy.float(0.5)
        return SimpleNamespace(throttle=rounded, steer=0.0, brake=0.0)
    """
    agent = load_agent(written(tmp_path, body))
    env = RouteEnv(**environment_options(QUIET, agent.requires))
    observation, _ = env.reset(seed=1)
    control, _ = agent.act(observation, agent.start(env.plan, 1))
    assert control.tolist() == [0.5, 0.0, 0.0]


def test_a_missing_file_is_named():
    with pytest.raises(AgentSpecError, match=r"there is no file .*nowhere\.py"):
        load_agent("carla:nowhere.py")


def test_an_agent_imports_what_lies_beside_its_file(tmp_path):
    (tmp_path / "beside_the_leaderboard_agent.py").write_text("THROTTLE = 0.25\n")
    own = """
    from beside_the_leaderboard_agent import THROTTLE

    def run_step(self, data, timestamp):
        return SimpleNamespace(throttle=self.THROTTLE, steer=0.0, brake=0.0)
    """
    agent, *_ = stepped(written(tmp_path, own))
    assert agent._class.THROTTLE == 0.25


def test_folders_of_the_path_come_first_for_the_agents_imports_and_ours_before_them(tmp_path):
    """A published repository brings `leaderboard` and `team_code`; ours of the one is kept."""
    repo = tmp_path / "repo"
    for folder in (repo / "leaderboard" / "leaderboard", repo / "leaderboard" / "team_code"):
        folder.mkdir(parents=True)
    (repo / "leaderboard" / "leaderboard" / "__init__.py").write_text("raise OSError('theirs')\n")
    (repo / "leaderboard" / "team_code" / "planner_of_theirs.py").write_text("THROTTLE = 0.5\n")
    own = """
    from team_code.planner_of_theirs import THROTTLE
    """
    spec = written(tmp_path, own) + f"?path={repo},{repo}/leaderboard"
    assert load_agent(spec)._class.THROTTLE == 0.5
    before = list(sys.path)
    assert before[:3] == [str(repo), str(repo / "leaderboard"), str(tmp_path)]
    with births():  # a process that is born now is handed sys.path, and has to find ours
        assert not [place for place in sys.path if place.startswith(str(tmp_path))]
    assert sys.path == before
    with pytest.raises(AgentSpecError, match=r"path: there is no folder .*nowhere"):
        load_agent(written(tmp_path) + "?path=nowhere")


def test_a_run_records_the_agents_own_sensors(tmp_path):
    """A rig is no JSON; the files name its cameras all the same."""
    own = "def run_step(self, data, timestamp):\n    return None"
    spec = RunSpec(agent=written(tmp_path, own), options=QUIET)
    folder = tmp_path / "run"
    folder.mkdir()
    console = Console(file=io.StringIO())
    evaluate(spec, [0], suite=load_suite("toy"), folder=folder, console=console)
    run = read_run(folder)
    assert run.requires["control_dt_s"] == 0.05
    assert run.requires["options"]["cameras"]["cameras"][0]["name"] == "camera_eye"
    assert json.dumps(run.requires["options"])


GPS_BODY = """
    def run_step(self, input_data, timestamp):
        self.CALLS.append((input_data["gps"][1], [gps for gps, _ in self._global_plan]))
        return SimpleNamespace(throttle=0.0, steer=0.0, brake=1.0)
"""
CONSTANTS = np.array([111324.60662786, 111319.490945])  # metres a degree, of agents for 0.9.10


@pytest.mark.parametrize(
    ("query", "exact"), [("", True), ("?origin=0,0", True), ("?origin=49,8", False)]
)
def test_the_constants_of_agents_for_0_9_10_give_the_next_target_to_a_decimetre(
    query, exact, tmp_path
):
    """North and east of 0, 0 as their planners count them; from 49, 8 they would be wrong."""
    spec = written(tmp_path, GPS_BODY) + query
    agent = load_agent(spec)
    env = RouteEnv(**environment_options(QUIET, agent.requires))
    observation, _ = env.reset(seed=1)
    agent.act(observation, agent.start(env.plan, 1))
    ((gps, targets),) = [call for call in agent._class.CALLS if isinstance(call[-1], list)]
    agent._class.CALLS.clear()
    place = np.array([targets[1]["lat"], targets[1]["lon"]])
    north, east = (place - gps[:2]) * CONSTANTS
    x, y = env.plan.points[env.plan.targets[1], :2] - [env.view.state.x[0], env.view.state.y[0]]
    noise_m = 2.0  # of GNSS, four times
    assert (abs(east - x) < noise_m and abs(north + y) < noise_m) == exact
    if exact:
        first = np.array([targets[0]["lat"], targets[0]["lon"]])
        north, east = (place - first) * CONSTANTS
        x, y = env.plan.points[env.plan.targets[1], :2] - env.plan.points[env.plan.targets[0], :2]
        assert (east, north) == (pytest.approx(x, abs=0.1), pytest.approx(-y, abs=0.1))


def test_the_example_does_the_same_by_the_constants_of_agents_for_0_9_10():
    """It reads the route's origin otherwise; here both are asked along one drive."""
    examples = Path(__file__).parents[3] / "examples"
    reads = load_agent(f"carla:{examples}/carla_leaderboard_agent.py")
    counts = load_agent(f"carla:{Path(__file__).parent}/by_constants.py?path={examples}")
    env = RouteEnv(**environment_options(QUIET, reads.requires))
    observation, _ = env.reset(seed=1)
    memories = [agent.start(env.plan, 1) for agent in (reads, counts)]
    for _ in range(12):
        control, memories[0] = reads.act(observation, memories[0])
        other, memories[1] = counts.act(observation, memories[1])
        assert other == pytest.approx(control, abs=0.002)
        observation, *_ = env.step(control)
    assert env.view.state.speed[0] > 0.5


def test_agents_of_leaderboard_two_count_from_the_maps_origin(tmp_path):
    assert "gnss_origin" not in load_agent(written(tmp_path) + "?leaderboard=2.1").requires.options
    asked = load_agent(written(tmp_path) + "?leaderboard=2.1&origin=49,8").requires
    assert asked.options["gnss_origin"] == (49.0, 8.0)
    assert Requirements.of_json(json.loads(json.dumps(asked.as_json()))).options == asked.options


def test_the_limits_of_the_leaderboard_hold_on_request(tmp_path):
    own = """
    def sensors(self):
        return [{"type": "sensor.other.gnss", "id": "gps", "x": 25.0, "y": 0.0, "z": 0.0}]
    """
    assert load_agent(written(tmp_path, own)).requires.observations == ("inertial",)
    with pytest.warns(UserWarning, match="25.00 m .* the Leaderboard allows 3 m"):
        load_agent(written(tmp_path, own) + "?limits=leaderboard").requires  # noqa: B018
