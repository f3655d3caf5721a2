"""Importing `di_envs`: what it registers, what it leaves unloaded, what it refuses."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import gymnasium
import pytest

import di_envs
from di_envs.config import OBSERVATION_GROUPS, RouteEnvConfig
from di_envs.shadowing import check_not_shadowed
from di_envs.suites import suite_names

TOP = Path(__file__).resolve().parents[2]
HEAVY = ("torch", "highway_env", "pandas", "matplotlib", "numba")


def run_python(code: str, *first_on_path: Path) -> subprocess.CompletedProcess[str]:
    """Runs code in a fresh interpreter that finds our checkout behind the folders given."""
    path = os.pathsep.join(str(folder) for folder in (*first_on_path, TOP))
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": path},
        cwd=TOP / "docs" / "images",  # where there is nothing to import; Python 3.10 has no -P
        capture_output=True,
        text=True,
        check=False,
    )


def run_command(command: list[str], *first_on_path: Path) -> subprocess.CompletedProcess[str]:
    """Runs a command as the console script does."""
    code = f"import sys, driveinsight; sys.argv[1:] = {command}; driveinsight.main()"
    return run_python(code, *first_on_path)


def test_importing_di_envs_leaves_heavy_packages_alone():
    code = (
        "import sys, time; start = time.perf_counter(); import di_envs;"
        "print(time.perf_counter() - start);"
        f"print([name for name in {HEAVY} if name in sys.modules])"
    )
    done = run_python(code)
    assert done.returncode == 0, done.stderr
    seconds, loaded = done.stdout.splitlines()
    print(f"import di_envs took {seconds} s")
    assert loaded == "[]"


@pytest.mark.parametrize("env_id", di_envs.ENVIRONMENTS)
def test_every_id_of_the_table_is_registered_with_a_shipped_suite(env_id):
    assert gymnasium.spec(env_id).kwargs == di_envs.ENVIRONMENTS[env_id].changes()
    assert di_envs.ENVIRONMENTS[env_id].suite in suite_names()


@pytest.mark.parametrize("env_id", di_envs.ENVIRONMENTS)
def test_an_id_of_a_version_before_makes_the_newest_and_is_warned_of(env_id):
    name, newest = env_id.rsplit("-v", 1)
    assert int(newest) >= 1
    for version in range(int(newest)):
        with pytest.warns(DeprecationWarning, match="out of date"):
            env = gymnasium.make(f"{name}-v{version}", disable_env_checker=True)
        assert env.unwrapped.config.suite == di_envs.ENVIRONMENTS[env_id].suite


def test_make_imports_the_module_named_before_the_id():
    done = run_python(
        "import gymnasium; print(gymnasium.make('di_envs:DriveInsight-Toy-v1').unwrapped.route_ids)"
    )
    assert done.returncode == 0, done.stderr


def test_an_unknown_name_in_di_envs_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'RoadEnv'"):
        _ = di_envs.RoadEnv


def test_the_environment_class_is_there_for_the_asking():
    from di_envs.route_env import RouteEnv

    assert di_envs.RouteEnv is RouteEnv


@pytest.mark.parametrize("name", ["agents", "leaderboard"])
def test_another_package_of_our_name_is_refused_with_both_places(tmp_path, name):
    other = tmp_path / name
    other.mkdir()
    (other / "__init__.py").write_text("")
    done = run_python("import di_envs", tmp_path)
    assert done.returncode == 1
    assert f"ImportError: `{name}` is DriveInsight's package at {TOP / name}" in done.stderr
    assert str(other) in done.stderr
    assert "PYTHONPATH" in done.stderr


@pytest.mark.parametrize("name", ["agents", "leaderboard"])
@pytest.mark.parametrize("command", [["agents"], ["suites"], ["evaluate", "--agent", "expert"], []])
def test_every_command_says_which_path_to_put_first_where_carlas_package_is(
    tmp_path, name, command
):
    other = tmp_path / name
    other.mkdir()
    (other / "__init__.py").write_text("")
    done = run_python(
        f"import sys, driveinsight; sys.argv[1:] = {command}; driveinsight.main()", tmp_path
    )
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)
    assert f"another one comes first: {other}" in done.stderr
    assert f"PYTHONPATH={TOP}:$PYTHONPATH driveinsight" in done.stderr


def test_with_ours_first_on_the_path_carlas_package_is_not_in_the_way(tmp_path):
    (tmp_path / "agents").mkdir()
    (tmp_path / "agents" / "__init__.py").write_text("")
    done = run_python(
        "import sys, driveinsight; sys.argv[1:] = ['agents']; driveinsight.main()", TOP, tmp_path
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_a_folder_of_our_name_that_is_no_package_hides_nothing(tmp_path):
    (tmp_path / "agents").mkdir()
    done = run_python("import di_envs", tmp_path)
    assert done.returncode == 0, done.stderr


def test_a_package_that_is_imported_already_is_refused_too(tmp_path):
    (tmp_path / "agents.py").write_text("")
    done = run_python(f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import agents, di_envs")
    assert done.returncode == 1
    assert "comes first" in done.stderr


def test_the_check_passes_where_nothing_is_hidden_and_where_nothing_is_ours(tmp_path):
    check_not_shadowed(TOP)
    check_not_shadowed(tmp_path)


def test_an_unknown_option_is_refused_with_a_suggestion():
    with pytest.raises(ValueError, match=r"'trafic'; did you mean 'traffic'\?"):
        gymnasium.make("DriveInsight-Toy-v1", trafic=3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "needs suite=NAME, or both town=FILE and routes=FILE"),
        ({"town": "x.xodr"}, "needs suite=NAME"),
        ({"suite": "toy", "observations": ("lidra",)}, "did you mean 'lidar'"),
        ({"suite": "toy", "lidar": "dnse"}, "did you mean 'dense'"),
        ({"suite": "toy", "observations": ("promt",)}, "did you mean 'prompt'"),
        ({"suite": "toy", "observations": "prompt"}, r"Try \('prompt',\)"),
        ({"suite": "toy", "observations": ()}, "observations is empty"),
        ({"suite": "toy", "weather": "ClearNon"}, "did you mean 'ClearNoon'"),
        ({"suite": "toy", "cameras": "papr"}, "did you mean 'paper'"),
        ({"suite": "toy", "rules": "carla-3.0"}, "known: carla-1.0"),
        ({"suite": "toy", "terminate_on": ("red_lights",)}, "did you mean 'red_light'"),
        ({"suite": "toy", "traffic": -1}, "traffic is a number of actors"),
        ({"suite": "toy", "walkers": 1.5}, "walkers is a number of actors"),
        ({"suite": "toy", "control_dt_s": 0.07}, "multiple of the world tick of 0.05 s"),
        ({"suite": "toy", "control_dt_s": 0.0}, "multiple of the world tick of 0.05 s"),
    ],
)
def test_a_refused_option_says_what_was_expected(options, message):
    with pytest.raises(ValueError, match=message):
        RouteEnvConfig.from_mapping(options)


def test_lists_of_names_become_tuples_as_json_has_only_lists():
    config = RouteEnvConfig(suite="toy", route_ids=[1, "2"], observations=["prompt"])
    assert config.route_ids == ("1", "2")
    assert config.observations == ("prompt",)
    assert set(config.observations) <= set(OBSERVATION_GROUPS)


def test_without_a_word_an_environment_shows_cameras_lidar_and_prompt():
    assert RouteEnvConfig(suite="toy").observations == ("camera", "lidar", "prompt")


def test_a_tenth_of_a_second_is_two_world_ticks():
    assert RouteEnvConfig(suite="toy").control_ticks == 2
    assert RouteEnvConfig(suite="toy", control_dt_s=0.15).control_ticks == 3
