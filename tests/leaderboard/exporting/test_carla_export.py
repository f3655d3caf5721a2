"""Agents exported to CARLA, driven here through our own adapter: they see and do the same."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import agents.driveinsight
from agents import load_agent, module_of_file
from agents.base import Track
from di_envs.prompt import COMPONENTS
from di_envs.route_env import RouteEnv
from di_envs.town.lanes import LightState
from di_envs.world.kinds import ActorKind
from leaderboard.commands.cli import main
from leaderboard.exporting.carla import FORMAT, SETTINGS_FILE, SOURCE, export_to_carla
from leaderboard.running.driver import environment_options

WAY = ("command", "target_point", "routing", "speed", "speed_history")
SHIPPED = Path(agents.driveinsight.__file__).parent / "weights" / "driveinsight"
QUIET = {"suite": "toy", "traffic": 8, "walkers": 4}
RECORDER = """
import numpy as np
from agents.base import Requirements, make_control


class Recorder:
    told = {told}
    requires = Requirements(
        observations=("camera", "lidar", "prompt", "odometry"), options={{"cameras": "rl"}}
    )

    def start(self, plan, seed):
        return 0

    def act(self, observation, memory):
        np.savez(f"seen-{{memory}}.npz", **observation)
        return make_control(0.6, 0.02, 0.0), memory + 1

    def close(self):
        pass
"""


def carla_agent(folder, track):
    privileged = "&track=PRIVILEGED" if track is Track.PRIVILEGED else ""
    return load_agent(f"carla:{folder}/agent.py?config={folder}/{SETTINGS_FILE}{privileged}")


def side_by_side(ours, theirs, decisions):
    """Both decide in worlds that are driven by ours; yields their controls."""
    envs, seen, memories = [], [], []
    for agent in (ours, theirs):
        env = RouteEnv(**environment_options(QUIET, agent.requires))
        seen.append(env.reset(seed=0, options={"route": "1"})[0])
        memories.append(agent.start(env.plan, 0))
        envs.append(env)
    for _ in range(decisions):
        control, memories[0] = ours.act(seen[0], memories[0])
        for tick in range(2):
            shown = {**seen[1], "world": envs[1].view} if theirs.requires.privileged else seen[1]
            answer, memories[1] = theirs.act(shown, memories[1])
            if tick == 0:
                yield control, answer
            seen[1], *_ = envs[1].step(control)
        seen[0], *_ = envs[0].step(control)
    theirs.close()


@pytest.mark.parametrize(
    ("told", "track", "off_m"), [(COMPONENTS, Track.PRIVILEGED, 0.001), (WAY, Track.SENSORS, 0.15)]
)
def test_an_exported_agent_sees_what_it_sees_here(told, track, off_m, tmp_path, monkeypatch):
    """Images to the bit; what it is told to the precision of CARLA's places, or of GNSS."""
    file = tmp_path / "recorder.py"
    file.write_text(RECORDER.format(told=told))
    written = export_to_carla(f"{file}:Recorder", tmp_path / "exported")
    assert written.track is track
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    theirs = carla_agent(written.folder, track)
    for control, answer in side_by_side(load_agent(f"{file}:Recorder"), theirs, 6):
        assert answer.tolist() == control.tolist()
    for decision in range(6):
        ours, seen = (np.load(f / f"seen-{decision}.npz") for f in (here, written.folder))
        assert (seen["camera_front"] == ours["camera_front"]).all()
        assert seen["prompt_present"].tolist() == [name in told for name in COMPONENTS]
        for name in (*told, "odometry"):
            assert np.abs(seen[name].astype(float) - ours[name]).max() < off_m, name
        assert seen["speed"] == ours["speed"]
    both = (seen["lidar"][:, 3] > 0.0) & (ours["lidar"][:, 3] > 0.0)
    away_m = np.linalg.norm(seen["lidar"][both, :3] - ours["lidar"][both, :3], axis=1)
    counts = [(points["lidar"][:, 3] > 0.0).sum() for points in (seen, ours)]
    assert 0.9 < counts[0] / counts[1] < 1.1
    assert np.median(away_m) < 0.2


@pytest.mark.full  # loads torch in two processes; CI proves that both see the same
@pytest.mark.parametrize(
    ("prompt", "most"), [(COMPONENTS, 0.1), (WAY, 0.2)], ids=["told", "sensors"]
)
def test_an_exported_policy_gives_the_controls_that_it_gives_here(prompt, most, tmp_path):
    """To what another LiDAR, and GNSS, change: see docs/agents.md."""
    folder = tmp_path / "policy"
    shutil.copytree(SHIPPED, folder)
    config = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps({**config, "prompt": prompt}))
    written = export_to_carla(f"driveinsight:{folder}", tmp_path / "exported")
    theirs = carla_agent(written.folder, written.track)
    pairs = np.array(list(side_by_side(load_agent(f"driveinsight:{folder}"), theirs, 6)))
    assert np.abs(pairs[:, 1] - pairs[:, 0]).max() < most


def test_the_command_writes_a_folder_and_says_the_track(tmp_path, capsys):
    arguments = ["export-agent", "constant", "--to", "carla", "--output", str(tmp_path / "out")]
    assert main(arguments) == 0
    assert "track PRIVILEGED" in capsys.readouterr().out
    settings = json.loads((tmp_path / "out" / SETTINGS_FILE).read_text())
    assert settings["agent"] == "constant"
    assert main(arguments) == 2
    assert "name another --output" in capsys.readouterr().err
    assert main(["export-agent", "expert", "--output", str(tmp_path / "other")]) == 2
    assert "reads the world's state" in capsys.readouterr().err


def test_the_exported_files_own_tables_are_ours():
    """It runs where nothing of ours can be imported, so it says some numbers again."""
    file = module_of_file("carla_file", SOURCE)
    assert file.FORMAT == FORMAT
    assert file.SETTINGS == SETTINGS_FILE
    assert {name.upper(): kind for name, kind in file.KINDS.items()} == {
        kind.name: kind for kind in ActorKind if 0 < kind < ActorKind.WALKER
    }
    assert (file.WALKER, file.DEBRIS) == (ActorKind.WALKER, ActorKind.DEBRIS)
    assert file.VENDING_MACHINE == ActorKind.VENDING_MACHINE
    assert {s.name.capitalize(): s for s in LightState if s} == file.LIGHTS
