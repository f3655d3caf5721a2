"""The view for people: what is where in the picture, that looking changes nothing, the window."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from PIL import Image, ImageColor

import di_envs
from di_envs.course import load_course
from di_envs.drawing.driver_view import DriverView
from di_envs.drawing.map_tiles import TILE_PX, MapTiles
from di_envs.drawing.outlines import (
    ACTOR,
    EGO,
    LAND,
    LIGHT,
    ROUTE,
    box,
    stop_line_colours,
    stop_line_ends,
)
from di_envs.drawing.prompt_text import prompt_in_words, where
from di_envs.drawing.view import HEIGHT_PX, MAP_PX, PIXELS_A_METRE, WIDTH_PX, Renderer
from di_envs.route_env import RouteEnv
from di_envs.town.loading import load_town
from di_envs.vector_env import RouteVectorEnv
from di_envs.world.kinds import ActorKind
from di_envs.world.state import views_of

GO = np.array([0.7, 0.0, 0.0], np.float32)
CENTRE = MAP_PX // 2
GROUPS = ("prompt", "inertial")  # quick: the panel has a test of its camera
QUIET = {"traffic": 0, "walkers": 0, "observations": GROUPS}


@pytest.fixture(scope="module")
def env():
    made = RouteEnv(suite="toy", traffic=8, walkers=4, observations=GROUPS, render_mode="rgb_array")
    yield made
    made.close()


@pytest.fixture
def started(env):
    env.reset(seed=2, options={"route": 0})
    return env


def near(pixel, colour, by=40):
    return np.abs(np.asarray(pixel, int) - ImageColor.getrgb(colour)).max() <= by


def pixel_of(env, x, y):
    """Column and row of a world place in the picture."""
    state = env.view.state
    column = CENTRE + (x - state.x[0]) * PIXELS_A_METRE
    row = CENTRE + (y - state.y[0]) * PIXELS_A_METRE
    return round(float(column)), round(float(row))


def test_the_ego_is_in_the_middle_of_the_map(started):
    frame = started.render()
    assert frame.shape == (HEIGHT_PX, WIDTH_PX, 3)
    assert frame.dtype == np.uint8
    assert near(frame[CENTRE, CENTRE], EGO)


def test_the_ego_is_as_long_as_it_is_at_seven_pixels_a_metre(started):
    frame = started.render()[:MAP_PX, :MAP_PX]
    rows, columns = np.nonzero((np.abs(frame - np.array(ImageColor.getrgb(EGO))) < 30).all(axis=2))
    longest = max(np.ptp(rows), np.ptp(columns)) / PIXELS_A_METRE
    assert longest == pytest.approx(4.90, abs=0.6)  # an outline's pixel at either end


def test_the_route_ahead_is_drawn_where_it_lies_and_not_behind(started):
    for _ in range(40):
        started.step(GO)
    frame, plan = started.render(), started.plan
    done = int(started.view.state.route_index[0])
    assert done > 8
    column, row = pixel_of(started, *plan.points[done + 6, :2])
    assert near(frame[row, column], ROUTE)
    column, row = pixel_of(started, *plan.points[done - 6, :2])
    assert not near(frame[row, column], ROUTE)


def test_a_stop_line_has_the_colour_of_its_light():
    town = RouteEnv(suite="town05_tiny", render_mode="rgb_array", **QUIET)
    seen = set()
    for seed in range(12):
        town.reset(seed=seed)
        ends, colours = stop_line_ends(town.view.town.signals), stop_line_colours(town.view)
        frame, done = town.render(), town.plan.points[:, :2]
        for middle, colour in zip(ends.mean(axis=1), colours, strict=True):
            column, row = pixel_of(town, *middle)
            inside = 20 < column < MAP_PX - 20 and 20 < row < MAP_PX - 20
            off_route = np.linalg.norm(done - middle, axis=1).min() > 2.0
            if colour in LIGHT.values() and inside and off_route and middle[0] > -150.0:
                assert near(frame[row, column], colour)
                seen.add(colour)
    assert len(seen) >= 2


def test_looking_changes_nothing(env):
    def drive(look):
        env.reset(seed=4)
        steps = []
        for _ in range(20):
            if look:
                env.render()
            steps.append(env.step(GO)[0]["obstacles"].tobytes())
        return steps, env.save_state().world.record.tobytes()

    assert drive(look=True) == drive(look=False)


def test_equal_states_give_equal_pictures_whatever_was_drawn_before(started):
    snapshot = started.save_state()
    before = started.render()
    for _ in range(15):
        started.step(GO)
    assert not np.array_equal(started.render(), before)
    started.restore_state(snapshot)
    assert np.array_equal(started.render(), before)


def test_the_panel_shows_a_camera_where_there_is_one(started):
    renderer = Renderer(started._course)
    red = np.zeros((144, 256, 3), np.uint8)
    red[:, :, 0] = 255
    without = renderer.frame(started.view)
    shown = renderer.frame(started.view, 0, {"camera_front": red})
    assert (shown[5:170, MAP_PX + 5 : WIDTH_PX - 5] == (255, 0, 0)).all()
    assert np.array_equal(shown[:, :MAP_PX], without[:, :MAP_PX])
    # the text has moved down by the picture's height: 320 px wide, so 180 px high
    assert np.array_equal(shown[180:400, MAP_PX:], without[0:220, MAP_PX:])


def test_a_picture_of_an_observation_is_the_one_that_render_gives():
    """With and without a second look through the front camera, and with no other sensor."""
    seeing = RouteEnv(suite="toy", traffic=2, walkers=2, render_mode="rgb_array")
    blind = RouteEnv(
        suite="toy", traffic=2, walkers=2, observations=GROUPS, render_mode="rgb_array"
    )
    observation, _ = seeing.reset(seed=2)
    blind.reset(seed=2)
    rendered = seeing.render()
    assert np.array_equal(seeing.picture(observation), rendered)
    assert not np.array_equal(seeing.picture({}), rendered)
    assert np.array_equal(seeing.picture({}), blind.render())


@pytest.mark.parametrize("kind", [kind for kind in ActorKind if kind != ActorKind.ABSENT])
def test_whatever_can_be_run_into_is_drawn_but_poles(started, kind):
    snapshot = started.save_state()
    record = np.atleast_1d(snapshot.world.record.copy())
    state = views_of(record)
    state.kind[1:] = ActorKind.ABSENT
    state.kind[1], state.z[1], state.yaw[1] = kind, state.z[0], 0.0
    state.x[1], state.y[1] = state.x[0], state.y[0] - 8.0
    state.half_length[1], state.half_width[1], state.walk_waiting[1] = 0.6, 0.5, 0
    world = dataclasses.replace(snapshot.world, record=record.reshape(snapshot.world.record.shape))
    started.restore_state(dataclasses.replace(snapshot, world=world))
    column, row = pixel_of(started, state.x[1], state.y[1])
    drawn = near(started.render()[row, column], ACTOR.get(kind, LAND), by=8)
    assert drawn == (kind != ActorKind.PROP)


def test_tiles_meet_without_a_seam(env):
    env.reset(seed=1)
    tiles = MapTiles(env.view.town, 4.0)
    whole = Image.new("RGB", (2 * TILE_PX, TILE_PX))
    tiles.paste(whole, -TILE_PX, 0, above=False)
    part = Image.new("RGB", (TILE_PX, TILE_PX))
    tiles.paste(part, -TILE_PX // 2, 0, above=False)
    half = TILE_PX // 2
    assert np.array_equal(np.array(whole)[:, half : half + TILE_PX], np.array(part))
    assert len(np.unique(np.array(whole).reshape(-1, 3), axis=0)) > 3


def test_between_the_lanes_of_a_junction_there_is_road():
    """Straight ahead of every stop line, across its width: where turns part, no land shows."""
    town = load_town("town05")
    scale, signals = 4.0, town.signals
    tiles = MapTiles(town, scale)
    level = signals.stop_pose[:, 2] < 1.0
    assert level.sum() > 100
    for (x, y, _, yaw), width in zip(
        signals.stop_pose[level], signals.stop_width_m[level], strict=True
    ):
        left, top = int(x * scale) - 60, int(y * scale) - 60
        picture = Image.new("RGB", (120, 120))
        tiles.paste(picture, left, top, above=False)
        colours = np.array(picture)
        for ahead in (1.0, 2.0, 4.0, 6.0):
            for right in np.linspace(-0.45, 0.45, 7) * width:
                column = (x + ahead * np.cos(yaw) - right * np.sin(yaw)) * scale - left
                row = (y + ahead * np.sin(yaw) + right * np.cos(yaw)) * scale - top
                assert not near(colours[int(row), int(column)], LAND, by=8), (x, y)


def test_beyond_the_town_there_is_land(env):
    env.reset(seed=1)
    tiles = MapTiles(env.view.town, 2.0)
    picture = Image.new("RGB", (50, 50))
    tiles.paste(picture, 100_000, 100_000, above=False)
    assert picture.getcolors() == [(2500, ImageColor.getrgb(LAND))]
    assert not tiles.paste(picture, 100_000, 100_000, above=True)


def test_a_box_has_its_nose_ahead():
    # 4 m long, 2 m wide, heading south (yaw 90 degrees, y down): the nose is at y = 2
    outline = box(0.0, 0.0, np.pi / 2, 2.0, 1.0)
    assert outline[3] == pytest.approx([0.0, 2.0])
    assert outline[0] == pytest.approx([1.0, -2.0])


# ---- the prompt in words


def test_a_place_in_words():
    assert where((32.4, 3.6)) == "32 m ahead, 4 m right"
    assert where((-5.2, 0.3)) == "5 m behind"
    assert where((0.0, -2.0)) == "0 m ahead, 2 m left"


def test_the_prompt_in_words_names_all_nine_components(env):
    observation, _ = env.reset(seed=2, options={"route": 0})
    words = dict(prompt_in_words(observation))
    assert len(words) == 9
    assert words["speed"] == "0.0 m/s (0 km/h)"
    count = int(observation["obstacles"][:, 8].sum())
    assert words["obstacles"].startswith(f"{count}; " if count else "none")
    assert words["map"] == f"{int(observation['map'][:, 0, 3].sum())} polylines"


# ---- modes


def test_frames_a_second_follow_from_the_time_between_decisions():
    env = RouteEnv(suite="toy", control_dt_s=0.05, **QUIET)
    assert env.metadata["render_fps"] == 20


def test_without_a_mode_rendering_warns_and_gives_nothing():
    env = RouteEnv(suite="toy", **QUIET)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.render()
    env.reset(seed=1)
    with pytest.warns(UserWarning, match="render_mode='rgb_array'"):
        assert env.render() is None


def test_an_unknown_mode_is_refused_with_a_suggestion():
    with pytest.raises(ValueError, match="did you mean 'rgb_array'"):
        RouteEnv(suite="toy", render_mode="rgb_aray")
    with pytest.raises(ValueError, match="Many worlds have no window"):
        RouteVectorEnv(2, suite="toy", render_mode="human")


def test_each_world_and_each_ego_has_a_picture_of_its_own():
    worlds = RouteVectorEnv(2, suite="toy", render_mode="rgb_array", **QUIET)
    worlds.reset(seed=1, options={"route": 0})
    alone = RouteEnv(suite="toy", render_mode="rgb_array", **QUIET)
    alone.reset(seed=1, options={"route": 0})
    frames = worlds.render()
    assert np.array_equal(frames[0], alone.render())
    egos = di_envs.parallel_env(2, suite="toy", render_mode="rgb_array", **QUIET)
    egos.reset(seed=1)
    assert near(egos.render()[CENTRE, CENTRE], EGO)
    assert not np.array_equal(egos.render("ego_0"), egos.render("ego_1"))


@pytest.mark.parametrize("route", [0, 1])
def test_behind_the_wheel_the_way_leads_up_from_the_ego(route, env):
    env.reset(seed=2, options={"route": route})
    course = load_course(env.config.changes())
    frame = DriverView(course, Renderer(course)).frame(env.view)
    assert frame.shape == (HEIGHT_PX, WIDTH_PX, 3)
    row, pixels_a_metre = 360 + 170 * 280 // 228, PIXELS_A_METRE * 640 / 520
    assert near(frame[row, CENTRE], EGO)
    ahead = frame[round(row - 7.0 * pixels_a_metre), CENTRE - 6 : CENTRE + 6]
    assert any(near(pixel, ROUTE) for pixel in ahead)


OPEN_A_WINDOW = """
import numpy as np, gymnasium, di_envs
env = gymnasium.make("DriveInsight-Toy-v1", traffic=0, walkers=0, render_mode="human")
env.reset(seed=1)
for _ in range(2):
    env.step(np.zeros(3, np.float32))
import pygame
assert pygame.display.get_surface().get_size() == (960, 640)
env.close()
assert not pygame.display.get_init()
print("shown")
"""


# Where programs, packages and caches are
_KEPT = ("PATH", "HOME", "PYTHONPATH", "XDG_CACHE_HOME", "DRIVEINSIGHT_CACHE")


def run_with(**environment):
    kept = {name: os.environ[name] for name in _KEPT if name in os.environ}
    return subprocess.run(
        [sys.executable, "-c", OPEN_A_WINDOW],
        env={**kept, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def test_a_window_opens_with_the_first_frame_and_closes():
    done = run_with(SDL_VIDEODRIVER="dummy")  # SDL's own stand-in for a display
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("shown\n")


@pytest.mark.parametrize("environment", [{}, {"SDL_VIDEODRIVER": "x11", "DISPLAY": ":97"}])
def test_without_a_display_the_error_says_what_to_do(environment):
    done = run_with(**environment)
    assert done.returncode == 1
    assert "There is no display to open a window on" in done.stderr
    assert "render_mode='rgb_array'" in done.stderr
