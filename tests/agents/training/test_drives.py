"""Drives as states: what is rendered from them is what was seen, and collecting keeps its word."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from agents import load_agent
from agents.training import collect as module
from agents.training.collect import DriveJob, Outcome, collect, drive_job, without_standing_tail
from agents.training.data_card import data_card, drive_paths
from agents.training.frames import (
    DriveFileError,
    DriveLog,
    DriveStage,
    read_drive,
    read_dropped,
    write_drive,
    write_dropped,
)
from agents.training.towns import town_files, training_plan, training_town
from agents.training.waypoints import expert_waypoints
from di_envs.observer import Observer
from di_envs.route_env import RouteEnv
from di_envs.world_version import WORLD_VERSION

SAME = "agents.expert.agent:Expert"  # under another name: a learner that needs no correction
IDLE = "tests.agents.training.learners:Idle"
GROUPS = ("camera", "lidar", "prompt", "odometry")


@pytest.fixture(scope="module")
def drive(drives):
    return read_drive(drive_paths(drives)[0])


@pytest.fixture(scope="module")
def env():
    options = {**town_files("small_grid").options(), "traffic": 30, "walkers": 10}
    options |= {"weather": "WetSunset", "cameras": "rl"}
    return RouteEnv(observations=GROUPS, **options)


@pytest.fixture(scope="module")
def driven(env):
    """What the environment showed while the expert drove, and its drive: all of it, and as kept."""
    observation, _ = env.reset(seed=5, options={"route": 0})
    agent = load_agent("expert")
    memory, shown = agent.start(env.plan, 5), []
    logs = DriveLog(view=env.view, reach_m=np.inf), DriveLog(view=env.view)
    for step in range(120):
        control, memory = agent.act({**observation, "world": env.view}, memory)
        if step % 5 == 0:
            shown.append(observation)
            for log in logs:
                log.add(control)
        observation, *_ = env.step(control)
    return shown, *(log.drive({"town": "small_grid"}) for log in logs)


def rendered(env, drive):
    stage = DriveStage(env.world.town, env.plan, drive.capacity)
    observer = Observer(env.world.town, GROUPS, cameras="rl")
    observer.start(stage.view)
    observer.change_weather("WetSunset")
    for moment in range(len(drive)):
        stage.set(drive, moment)
        yield observer.observe()


def test_what_is_rendered_from_all_actors_is_what_was_seen_to_the_bit(env, driven):
    shown, whole, _ = driven
    for seen, again in zip(shown, rendered(env, whole), strict=True):
        assert seen.keys() == again.keys()
        for name in seen:
            assert seen[name].tobytes() == again[name].tobytes(), name


def test_what_is_kept_is_enough_but_for_the_far_away_in_pictures(env, driven):
    shown, whole, kept = driven
    assert len(kept.actor_id) < len(whole.actor_id)
    other = []
    for seen, again in zip(shown, rendered(env, kept), strict=True):
        for name in seen.keys() - {"camera_front"}:
            assert seen[name].tobytes() == again[name].tobytes(), name
        other.append((seen["camera_front"] != again["camera_front"]).any(axis=2).mean())
    assert 0.0 < max(other) < 0.02  # share of pixels


def test_an_ego_set_aside_stands_a_metre_to_the_right_and_turned(drive):
    plan = training_plan("small_grid", drive.facts["route_id"])
    stage = DriveStage(training_town("small_grid"), plan, drive.capacity)
    x, y, yaw = drive.poses()[20]
    stage.set(drive, 20, right_m=1.0, turn_rad=0.1)
    state = stage.view.state
    assert state.x[0] == pytest.approx(x + np.cos(yaw + np.pi / 2))
    assert state.y[0] == pytest.approx(y + np.sin(yaw + np.pi / 2))
    assert state.yaw[0] == pytest.approx(yaw + 0.1)


def eastward(drive):
    """The drive's first moments, as if it went east along y = 0 at 8 m/s: 4 m a moment."""
    cut = drive.cut(12)
    actors = {name: values.copy() for name, values in cut.actors.items()}
    own = cut.first[:-1]
    actors["x"][own], actors["y"][own], actors["yaw"][own] = 4.0 * np.arange(12), 0.0, 0.0
    return dataclasses.replace(cut, actors=actors)


def test_waypoints_lead_back_to_where_the_expert_drove(drive):
    # From 1 m to its right (south) the expert's path lies 1 m to the left.
    ways, valid = expert_waypoints(eastward(drive), 0, 8, np.array([0.0, 1.0, 0.0]))
    assert ways.tolist() == [[4.0 * k, -1.0] for k in range(1, 9)]
    assert valid.tolist() == [1.0] * 8
    # Turned to the right by 90 degrees (southward), east is to the left.
    ways, _ = expert_waypoints(eastward(drive), 0, 8, np.array([0.0, 0.0, np.pi / 2]))
    assert ways == pytest.approx(np.array([[0.0, -4.0 * k] for k in range(1, 9)]), abs=1e-5)


def test_waypoints_beyond_the_end_of_a_drive_do_not_count(drive):
    ways, valid = expert_waypoints(eastward(drive), 8, 8, np.array([32.0, 0.0, 0.0]))
    assert valid.tolist() == [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert ways[:3].tolist() == [[4.0, 0.0], [8.0, 0.0], [12.0, 0.0]]


def test_the_standing_tail_of_a_drive_is_cut(drive):
    actors = {name: values.copy() for name, values in drive.actors.items()}
    own = drive.first[:-1]
    actors["speed"][own] = 5.0
    actors["speed"][own[30:]] = 0.0  # it stands for good from moment 30 on
    standing = dataclasses.replace(drive, actors=actors)
    assert len(without_standing_tail(standing)) == 30
    actors["speed"][own[-1]] = 5.0  # it was only waiting
    assert len(without_standing_tail(standing)) == len(drive)


def test_a_drive_comes_back_from_its_file_as_it_was(drive, tmp_path):
    write_drive(tmp_path / "x.npz", drive)
    again = read_drive(tmp_path / "x.npz")
    assert again.facts == drive.facts
    assert again.capacity == drive.capacity
    for name, values in {**drive.whole, **drive.actors}.items():
        theirs = again.whole.get(name, again.actors.get(name))
        assert theirs.dtype == values.dtype
        assert theirs.tobytes() == values.tobytes()


def test_a_file_cut_off_or_missing_says_what_to_do(drives, tmp_path):
    whole = drive_paths(drives)[0].read_bytes()
    (tmp_path / "cut.npz").write_bytes(whole[: len(whole) // 2])
    for name in ("cut.npz", "missing.npz"):
        with pytest.raises(DriveFileError, match=f"{name}.*delete it and run collect again"):
            read_drive(tmp_path / name)


def files_of(folder):
    return {path.relative_to(folder): path.read_bytes() for path in sorted(folder.glob("*/*"))}


def test_collecting_gives_the_same_files_stopped_or_not_with_one_process_or_two(tmp_path):
    once, again = tmp_path / "once", tmp_path / "again"
    list(collect(once, ["small_grid"], 400, workers=2))
    stopped = collect(again, ["small_grid"], 400, workers=1)
    first = next(stopped)
    stopped.close()  # as after Ctrl-C
    outcomes = list(collect(again, ["small_grid"], 400, workers=1))
    assert outcomes[0] == dataclasses.replace(first, fresh=False)
    assert files_of(once) == files_of(again)
    later = [
        outcome.job.number for outcome in collect(tmp_path / "later", ["small_grid"], 1, first=1)
    ]
    assert later == [1]
    assert files_of(tmp_path / "later").items() <= files_of(once).items()
    card = data_card(once)
    assert card["moments"] == sum(outcome.moments for outcome in outcomes) >= 400
    assert card["by_town"] == {"small_grid": card["moments"]}
    assert sum(card["by_command"].values()) == card["moments"]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"why": 3}', "[" * 100_000], ids=len)
def test_a_garbled_reason_for_a_dropped_drive_says_what_to_do(tmp_path, text):
    path = tmp_path / "a.dropped.json"
    write_dropped(path, "red light", {"driver": "expert"})
    assert read_dropped(path) == {"why": "red light", "driver": "expert"}
    path.write_text(text)
    with pytest.raises(DriveFileError, match=r"a\.dropped\.json does not say why .*run collect"):
        read_dropped(path)


def test_a_drive_with_an_infraction_is_dropped_and_stays_dropped(tmp_path, monkeypatch):
    # the expert that heeds no light, in its place
    monkeypatch.setattr(module, "_driver", lambda name: load_agent("expert-redrunner"))
    outcomes = [
        drive_job(DriveJob(folder=tmp_path, town="small_grid", number=number))
        for number in range(4)
    ]
    dropped = [outcome for outcome in outcomes if "red_light" in outcome.why]
    assert dropped
    job = dropped[0].job
    assert not job.path.exists()
    assert json.loads(job.dropped_path.read_text())["why"] == dropped[0].why
    assert drive_job(job) == Outcome(job=job, moments=0, why=dropped[0].why)


def other_weights(folder, monkeypatch):
    (folder / "weights.safetensors").write_bytes(b"those")
    module._driven_by.cache_clear()  # as in another process


def other_world(folder, monkeypatch):
    monkeypatch.setattr(module, "WORLD_VERSION", 0)
    module._driven_by.cache_clear()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (other_weights, "agent_version was driveinsight 2, files .*, is driveinsight 2, files"),
        (other_world, f"world_version was {WORLD_VERSION}, is 0"),
    ],
)
@pytest.mark.parametrize("dropped", [False, True])
def test_collecting_goes_on_with_the_same_driver_and_world_only(
    drive, tmp_path, monkeypatch, change, message, dropped
):
    """Weights changed under the same name were mixed silently before."""
    monkeypatch.setattr(module, "_drive", None)  # nothing may be driven
    (tmp_path / "weights.safetensors").write_bytes(b"these")
    job = DriveJob(folder=tmp_path, town="small_grid", number=0, driver=f"driveinsight:{tmp_path}")
    facts = module._common(job)
    if dropped:
        job.dropped_path.parent.mkdir()
        job.dropped_path.write_text(json.dumps({"why": "infractions", **facts}))
    else:
        write_drive(job.path, dataclasses.replace(drive, facts={**drive.facts, **facts}))
    assert not drive_job(job).fresh
    change(tmp_path, monkeypatch)
    with pytest.raises(DriveFileError, match=f"{message}.*name another --output"):
        drive_job(job)
    module._driven_by.cache_clear()


def test_from_a_learners_moments_the_expert_shows_what_it_would_have_done(tmp_path):
    """A learner that is the expert itself is shown its own way; one that stands still, to go."""
    one = DriveJob(folder=tmp_path / "expert", town="small_grid", number=0)
    other = dataclasses.replace(one, folder=tmp_path / "same", driver=SAME)
    assert drive_job(one).moments == drive_job(other).moments > 20
    driven, same = read_drive(one.path), read_drive(other.path)
    assert same.facts["driver"] == SAME
    np.testing.assert_array_equal(driven.poses(), same.poses())
    for moment in (0, 7, len(driven) - 3):
        future = driven.future(moment)[:8]
        np.testing.assert_array_equal(same.future(moment)[: len(future)], future)
    waiting = dataclasses.replace(one, folder=tmp_path / "idle", driver=IDLE)
    drive_job(waiting)
    idle = read_drive(waiting.path)
    assert idle.facts["finished"] == "standing"
    assert np.ptp(idle.poses()[:, :2], axis=0).max() < 0.5
    assert max(np.hypot(*(idle.future(m)[-1] - idle.poses()[m, :2])) for m in range(60)) > 5.0


def test_a_folder_holds_the_drives_of_one_driver(tmp_path):
    job = DriveJob(folder=tmp_path, town="small_grid", number=0, driver=IDLE)
    drive_job(job)
    with pytest.raises(
        DriveFileError, match=r"driver was .*Idle, is expert.*name another --output"
    ):
        drive_job(dataclasses.replace(job, driver="expert"))
