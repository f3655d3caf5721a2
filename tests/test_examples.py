"""The examples run as they are, and print what they teach."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from agents import load_agent
from agents.base import Track
from leaderboard.running.driver import Driver
from leaderboard.running.jobs import Job, RunSpec
from tests.carla_wheel import carla_wheel

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


def printed(name, *arguments):
    """What an example prints, run as a user would; warnings are errors there too."""
    done = subprocess.run(
        [sys.executable, "-W", "error", str(EXAMPLES / name), *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def number(pattern, text):
    found = re.search(pattern, text)
    assert found, f"no {pattern!r} in:\n{text}"
    return float(found[1])


def test_every_example_is_run_here():
    text = Path(__file__).read_text(encoding="utf-8")
    for path in EXAMPLES.glob("*.py"):
        assert f'"{path.name}"' in text, path.name


def test_driving_a_route_returns_its_score_in_metres():
    text = printed("drive_a_route.py")
    score = number(r"driving score ([\d.]+)", text)
    assert "ended by: completed" in text
    assert score > 90.0
    # the claim of the example: return = length x score / 100
    length_m = number(r"m of ([\d.]+) m", text)
    shown_to = 0.05 * (1.0 + length_m / 100.0)  # half a unit of the last digit of each
    assert number(r"return ([\d.]+) m", text) == pytest.approx(
        length_m * score / 100.0, abs=2.0 * shown_to
    )


def test_a_stand_in_for_a_language_model_drives_by_the_text_alone():
    text = printed("language_model_agent.py")
    assert "routing: a point each 5 m: (5.0, " in text
    assert "ended by: completed" in text
    assert number(r"driving score ([\d.]+)", text) > 60.0


def test_branches_differ_by_their_control_alone():
    text = printed("save_branch_restore.py")
    assert "same branch, same bits: True" in text
    assert "other control, other bits: True" in text
    assert number(r"go on +speed after 4 s: +([\d.]+)", text) > 1.0
    assert number(r"brake +speed after 4 s: +([\d.]+)", text) == 0.0


def test_an_agent_of_ones_own_completes_a_route():
    text = printed("your_own_agent.py")
    assert "ended by: completed" in text
    assert number(r"driving score ([\d.]+)", text) > 60.0


def test_the_agent_of_the_example_is_scored_by_its_path():
    spec = f"{EXAMPLES / 'your_own_agent.py'}:RouteFollower"
    agent = load_agent(spec)
    assert agent.requires.track == Track.PROMPT
    with Driver(RunSpec(agent=spec, options={"suite": "town05_tiny"})) as driver:
        record = driver.drive(Job(index=0, route_id=driver.env.route_ids[0], seed=0))
    assert record.reason == ""
    assert record.score.route_completion > 60.0


def test_a_model_is_trained_and_then_scored(tmp_path):
    pytest.importorskip("stable_baselines3", reason="needs the extra rl")
    model = tmp_path / "ppo.zip"
    arguments = ("--model", str(model), "--steps", "1024", "--worlds", "4", "--traffic", "4")
    text = printed("train_ppo.py", *arguments, "--rollout", "1024", "--threads", "1")
    assert f"sb3:{model}" in text
    assert "driving_score" in (tmp_path / "ppo.monitor.csv").read_text().splitlines()[1]
    agent = load_agent(f"sb3:{model}")
    assert agent.requires.control_dt_s == 0.2  # the model says so
    assert agent.requires.track == Track.PROMPT
    options = {"suite": "town05_tiny", "traffic": 4}
    with Driver(RunSpec(agent=f"sb3:{model}", options=options)) as driver:
        record = driver.drive(Job(index=0, route_id=driver.env.route_ids[0], seed=0))
    assert record.reason == ""
    assert record.score.route_completion > 5.0  # it is made to drive off from the start


def test_a_policy_of_one_file_learns_what_is_to_be_gained_and_drives(tmp_path):
    pytest.importorskip("torch", reason="needs the extra policy")
    arguments = ("--env", "DriveInsight-Toy-v1", "--traffic", "4", "--walkers", "0")
    arguments += ("--steps", "8192", "--worlds", "16", "--threads", "1")
    text = printed("ppo_single_file.py", *arguments, "--folder", str(tmp_path))
    assert "8,192 steps" in text
    first = number(r"first update ([\d.]+)", text)
    assert number(r"last ([\d.]+)\n", text) < 0.5 * first
    assert number(r"episodes in training: ([\d.]+)", text) > 10.0
    agent = re.search(r"--agent (pickled:\S+)", text)
    assert agent
    options = {"suite": "toy", "traffic": 4, "walkers": 0}
    with Driver(RunSpec(agent=agent[1], options=options)) as driver:
        record = driver.drive(Job(index=0, route_id=driver.env.route_ids[0], seed=0))
    assert record.reason == ""
    assert record.score.route_completion > 20.0


@pytest.mark.full
def test_a_policy_is_taught_from_nothing_and_set_beside_constant(tmp_path):
    pytest.importorskip("torch", reason="needs the extra policy")
    recipe, small = tmp_path / "tiny.toml", {"steps": "2", "frames": "20"}
    text = (EXAMPLES.parent / "recipes" / "tiny.toml").read_text(encoding="utf-8")
    for name, value in small.items():
        text = re.sub(rf"^{name} = .*$", f"{name} = {value}", text, flags=re.MULTILINE)
    text = text.replace("frames = 20", 'frames = 20\ntowns = ["small_grid"]')
    recipe.write_text(text.replace("frames = 20", "frames = 320", 1))  # two drives of the expert
    arguments = ["--folder", str(tmp_path), "--recipe", str(recipe)]
    arguments += ["--workers", "1", "--route-ids", "0"]
    text = printed("train_tiny.py", *arguments)
    assert "$ driveinsight train --recipe" in text
    assert "Stage 7 of 7, tiny: waypoint loss" in text
    constant, tiny = (number(rf"{name} +│ +([\d.]+)", text) for name in ("constant", "tiny"))
    assert 0.0 <= tiny <= 100.0
    assert constant > 0.0
    again = printed("train_tiny.py", *arguments)
    assert "All 7 stages are done" in again
    assert "Stage 7 of 7" not in again


LEADERBOARD_AGENT_FILE = "carla_leaderboard_agent.py"
LEADERBOARD_AGENT = f"carla:{EXAMPLES / LEADERBOARD_AGENT_FILE}"

# As many decisions as lead round a corner, hashed; `carla` is hidden where the argument says so
HASHED = """
import hashlib
import sys
if sys.argv[2] == "hidden":
    sys.modules["carla"] = None
from agents import load_agent
from di_envs import RouteEnv
from leaderboard.running.driver import environment_options
agent = load_agent(sys.argv[1])
suite = {"suite": "town05_short", "traffic": 10, "walkers": 0, "route_ids": ("14",)}
env = RouteEnv(**environment_options(suite, agent.requires))
observation, _ = env.reset(seed=0)
memory, digest = agent.start(env.plan, 0), hashlib.sha256()
for _ in range(150):
    control, memory = agent.act(observation, memory)
    observation, *_, info = env.step(control)
    digest.update(control.tobytes())
assert info["route_completion"] > 30.0, info
print(digest.hexdigest(), type(agent._agent.control(5.0)).__module__)
"""


def test_a_leaderboard_agent_drives_the_same_with_carlas_wheel_and_without():
    carla_wheel()
    told = [
        subprocess.run(
            [sys.executable, "-W", "error", "-c", HASHED, LEADERBOARD_AGENT, how],
            capture_output=True,
            text=True,
            check=True,
            timeout=600,
        ).stdout.split()
        for how in ("seen", "hidden")
    ]
    assert told[0][0] == told[1][0]
    assert (told[0][1], told[1][1]) == ("carla.libcarla", "agents.carla.values")


@pytest.mark.parametrize(("leaderboard", "route"), [("1.0", "10"), ("2.1", "14")])
def test_the_leaderboard_agent_completes_a_route_by_its_sensors(leaderboard, route):
    spec = f"{LEADERBOARD_AGENT}?leaderboard={leaderboard}"
    assert load_agent(spec).requires.track == Track.SENSORS
    options = {"suite": "town05_short", "scenarios": "none", "route_ids": (route,)}
    with Driver(RunSpec(agent=spec, options=options)) as driver:
        record = driver.drive(Job(index=0, route_id=route, seed=0))
    assert record.reason == ""
    assert record.score.driving_score > 90.0
