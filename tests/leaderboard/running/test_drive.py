"""`driveinsight drive`: the drive that evaluate scores, its events, and the video of it."""

from __future__ import annotations

import dataclasses
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rich.console import Console

import di_envs.planned_routes
from agents.expert.agent import Expert
from di_envs.route_env import RouteEnv
from di_envs.sensors.camera.cameras import CameraRig
from di_envs.sensors.camera.config import Rig, rig_of
from di_envs.suites import load_suite
from di_envs.world.state import EventKind
from di_envs.world.world import Event
from leaderboard.commands.cli import EXIT_USAGE, main
from leaderboard.running.drive import drive, event_line
from leaderboard.running.driver import Driver
from leaderboard.running.front_camera import FRONT, front_camera, with_front_camera
from leaderboard.running.interventions import read_interventions
from leaderboard.running.jobs import Job, RunSpec
from leaderboard.running.video import (
    GIF_WIDTH_PX,
    LONG_GIF_WIDTH_PX,
    VideoError,
    check_video,
    open_video,
    video_facts,
)
from leaderboard.running.warm_up import WARM_UP_STEPS

ROUTE = load_suite("toy").specs()[0].route_id
SPEC = RunSpec(agent="expert", options={"suite": "toy", "traffic": 3, "walkers": 2})
TOY = ["drive", "--suite", "toy", "--traffic", "3", "--walkers", "2", "--route", ROUTE]


@pytest.fixture
def silent(tmp_path):
    with open(tmp_path / "console", "w", encoding="utf-8") as file:
        yield Console(file=file)


@pytest.fixture(scope="module")
def scored():
    """What `evaluate` makes of the route."""
    with Driver(SPEC) as driver:
        return driver.drive(Job(index=0, route_id=ROUTE, seed=2))


def test_it_is_the_drive_that_evaluate_scores_whether_it_is_filmed_or_not(scored, silent, tmp_path):
    watched = drive(SPEC, route_id=ROUTE, seed=2, console=silent)
    assert watched.fingerprint() == scored.fingerprint()
    film = tmp_path / "films" / "one.gif"
    filmed = drive(SPEC, route_id=ROUTE, seed=2, console=silent, video=film)
    assert filmed.fingerprint() == scored.fingerprint()
    with Image.open(film) as gif:
        assert gif.size == (GIF_WIDTH_PX, 320)
        # a frame for the reset and one a step; frames that are all alike are merged
        durations = []
        for frame in range(gif.n_frames):
            gif.seek(frame)
            durations.append(gif.info["duration"])
    assert sum(durations) == 100 * (filmed.steps + 1)
    assert len(durations) > 0.5 * filmed.steps


def test_the_agent_and_the_film_share_one_look_of_one_camera(silent, tmp_path, monkeypatch):
    """The expert needs no camera: the front one is there for the film, and looks once a step."""
    looks = []
    observe = CameraRig.observe

    def counted(rig, only=None):
        images = observe(rig, only)
        looks.append(list(images))
        return images

    monkeypatch.setattr(CameraRig, "observe", counted)
    film = tmp_path / "one.gif"
    record = drive(SPEC, route_id=ROUTE, seed=2, console=silent, video=film)
    warmed = 1 + WARM_UP_STEPS  # to compile what the film needs, before the clock runs
    assert looks == [["camera_front"]] * (warmed + 1 + record.steps)


@pytest.mark.parametrize("filmed", [False, True])
def test_agent_environment_and_route_are_made_once(filmed, silent, tmp_path, monkeypatch):
    assert len(load_suite("toy").specs()) > 1
    made = []

    def count(owner, name):
        original = getattr(owner, name)

        def counted(*arguments, **named):
            made.append(f"{owner.__name__}.{name}")
            return original(*arguments, **named)

        monkeypatch.setattr(owner, name, counted)

    count(RouteEnv, "__init__")
    count(Expert, "__init__")
    count(di_envs.planned_routes, "plan_route")
    record = drive(SPEC, seed=2, console=silent, video=tmp_path / "one.gif" if filmed else None)
    assert record.route_id == ROUTE
    assert sorted(made) == [
        "Expert.__init__",
        "RouteEnv.__init__",
        "di_envs.planned_routes.plan_route",
    ]


HIDING_AGENT = '''
from agents.base import Requirements, make_control


class Counting:
    """Steers by how often it was asked, and tells nobody."""

    requires = Requirements(observations=("inertial",), branchable=False)
    asked = 0

    def start(self, plan, seed):
        return None

    def act(self, observation, memory):
        self.asked += 1
        return make_control(0.3, 0.01 * self.asked, 0.0), memory

    def close(self):
        pass
'''


def test_an_agent_that_hides_its_memory_has_not_decided_before_its_drive(silent, tmp_path):
    path = tmp_path / "counting.py"
    path.write_text(HIDING_AGENT)
    spec = dataclasses.replace(SPEC, agent=f"{path}:Counting")
    record = drive(spec, route_id=ROUTE, console=silent)
    assert record.control_array()[0, 1] == np.float32(0.01)


def test_an_edited_drive_is_the_one_that_evaluate_scores_camera_or_not(silent, tmp_path):
    spec = RunSpec(
        agent=f"{Path(__file__).parents[1] / 'route_followers.py'}:RouteFollower",
        options={"suite": "toy", "traffic": 0, "walkers": 0},
        interventions=read_interventions("noise:routing,sigma=0.3; delay:speed,steps=2"),
    )
    with Driver(spec) as driver:
        scored = driver.drive(Job(index=0, route_id=ROUTE, seed=1))
    film = tmp_path / "one.gif"
    filmed = drive(spec, route_id=ROUTE, seed=1, console=silent, video=film)
    assert filmed.fingerprint() == scored.fingerprint()
    assert filmed.interventions == ("noise:routing,sigma=0.3", "delay:speed,steps=2")


def test_the_front_camera_of_the_runs_own_rig_is_used_and_the_shipped_one_where_it_has_none():
    shipped = front_camera("small")
    back = rig_of("small").cameras[-1]
    assert back.name != FRONT
    for given, expected in (("rl", front_camera("rl")), (Rig(cameras=(back,)), shipped)):
        options = with_front_camera({"observations": ("prompt",), "cameras": given})
        assert options == {
            "observations": ("prompt", "camera"), "cameras": Rig(cameras=(expected,)),
        }  # fmt: skip
    assert with_front_camera({"observations": ("prompt",)})["cameras"] == Rig(cameras=(shipped,))
    seeing = {"observations": ("camera",), "cameras": "rl"}
    assert with_front_camera(seeing) == seeing


def test_a_film_has_a_frame_for_the_reset_and_one_for_every_step(tmp_path, capsys):
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="no ffmpeg to look at the film with")
    film = tmp_path / "one.mp4"
    arguments = [*TOY, "--agent", "expert", "--seed", "2", "--no-camera", "--video", str(film)]
    assert main(arguments) == 0
    shown = capsys.readouterr()
    frames, seconds = ffmpeg.count_frames_and_secs(str(film))
    game_s = float(shown.out.split("took")[1].split()[0])
    assert frames == round(game_s / 0.1) + 1
    assert seconds == pytest.approx(game_s + 0.1, abs=0.06)
    reader = ffmpeg.read_frames(str(film))
    assert next(reader)["source_size"] == (960, 640)
    picture = np.frombuffer(next(reader), np.uint8).reshape(640, 960, 3)
    assert np.abs(picture[320, 320].astype(int) - (255, 90, 54)).max() < 40  # the ego
    reader.close()
    assert f"Written: {film}" in shown.out


def test_events_are_shown_as_they_happen_and_the_score_at_the_end(capsys):
    assert main([*TOY, "--agent", "random"]) == 0
    shown = capsys.readouterr()
    assert " s  " in shown.err
    assert " at (" in shown.err
    assert f"Route {ROUTE}, seed 0: " in shown.out
    assert "driving score" in shown.out


def test_an_event_as_a_line():
    event = Event(kind=EventKind.OUTSIDE_LANES, ego=0, tick=246, x=10.0, y=-4.52, z=0.0, value=3.0)
    assert event_line(event) == "   12.3 s  outside lanes, 3.0 m at (10.0, -4.5)"


def refused(arguments, capsys):
    assert main(arguments) == EXIT_USAGE
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    return lines[0]


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (["--agent", "exprt"], "did you mean 'expert'?"),
        (["--agent", "expert", "--video", "film.avi"], ".mp4, .mkv, .mov, .gif; got 'film.avi'"),
        (["--agent", "expert", "--route", "99"], "Unknown route id"),
        (["--agent", "expert", "--weather", "ClearNon"], "did you mean 'ClearNoon'?"),
    ],
)
def test_a_wrong_request_is_one_line_with_a_hint(arguments, hint, capsys):
    assert hint in refused(["drive", "--suite", "toy", *arguments], capsys)


def test_without_ffmpeg_the_error_says_what_to_do(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    line = refused([*TOY, "--agent", "expert", "--video", "films/one.mp4"], capsys)
    assert "there is no ffmpeg to write 'films/one.mp4'" in line
    assert "driveinsight[video]" in line
    assert "--video films/one.gif" in line


@pytest.mark.parametrize(
    "says", ["echo Unknown encoder libx264 >&2; exit 1", "exit 3", "kill -9 $$"]
)
def test_an_ffmpeg_that_does_not_work_is_told_before_anything_is_driven(
    says, monkeypatch, capsys, tmp_path
):
    program = tmp_path / "ffmpeg"
    program.write_text(f"#!/bin/sh\n{says}\n")
    program.chmod(0o755)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr(shutil, "which", lambda _name: str(program))
    film = tmp_path / "one.mp4"
    assert main([*TOY, "--agent", "expert", "--video", str(film)]) == EXIT_USAGE
    printed = capsys.readouterr()
    said = "Unknown encoder libx264" if "echo" in says else "it said nothing"
    assert f"{program} does not work: {said}: pip install" in printed.err
    assert "Written" not in printed.out
    assert not film.exists()


def test_a_gif_needs_no_ffmpeg(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    assert check_video(tmp_path / "one.gif") is None


def test_what_ffmpeg_complains_of_is_passed_on(tmp_path):
    program = shutil.which("false")
    frame = np.zeros((640, 960, 3), np.uint8)
    writer = open_video(tmp_path / "one.mp4", 10.0, ffmpeg=program)
    with pytest.raises(VideoError, match="could not write"), writer:
        writer.add(frame)


def test_a_gif_of_fast_frames_leaves_some_out_and_keeps_its_pace(tmp_path):
    rng = np.random.Generator(np.random.PCG64(0))
    with open_video(tmp_path / "one.gif", 20.0) as writer:
        for _ in range(9):
            writer.add(rng.integers(0, 255, (32, 48, 3), np.uint8))
    with Image.open(tmp_path / "one.gif") as gif:
        assert gif.n_frames == 5
        assert gif.info["duration"] == 100


@pytest.mark.parametrize(
    ("frames", "width_px", "frame_ms"),
    [(4, GIF_WIDTH_PX, 100), (6, LONG_GIF_WIDTH_PX, 100), (10, LONG_GIF_WIDTH_PX, 200)],
)
def test_a_long_gif_has_smaller_pictures_and_then_fewer(
    frames, width_px, frame_ms, tmp_path, monkeypatch
):
    """Limits of 4 and 8 frames in place of 600 and 1200, for the test's sake."""
    monkeypatch.setattr("leaderboard.running.video.GIF_FRAMES", 4)
    monkeypatch.setattr("leaderboard.running.video.LONG_GIF_FRAMES", 8)
    path = tmp_path / "long.gif"
    with open_video(path, 10.0) as film:
        for number in range(frames):
            film.add(np.full((20, 30, 3), 20 * number, np.uint8))
    with Image.open(path) as gif:
        assert gif.width == width_px
        assert gif.info["duration"] == frame_ms
        assert gif.n_frames == frames * 100 // frame_ms
    assert video_facts(path).endswith(f" MB, {width_px} x {gif.height} pixels")
