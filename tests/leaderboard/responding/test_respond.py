"""`driveinsight respond` on a recorded drive: measured, kept, drawn; refused with what to do."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
import torch
from PIL import Image

from agents.driveinsight.config import (
    CameraEncoderConfig,
    FusionConfig,
    PlannerConfig,
    PolicyConfig,
)
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import save_pretrained
from agents.explain.responses import responses_at
from agents.networks.grid import GridConfig
from di_envs.world.state import EventKind
from leaderboard.commands.cli import EXIT_USAGE, main
from leaderboard.records.record import EventRecord
from leaderboard.records.results import write_run
from leaderboard.replaying.recorded_agent import retrace_env, run_agent
from leaderboard.replaying.retracing import retrace
from leaderboard.responding import measuring
from leaderboard.responding.drive_responses import drive_responses
from leaderboard.responding.response_files import (
    ResponseFileError,
    read_responses,
    responses_file,
    write_responses,
)
from tests.leaderboard.short_drives import short_run

DECISIONS = 12
CONFIG = PolicyConfig(
    name="prompt",
    camera=None,
    lidar=None,
    memory_frames=0,
    planner=PlannerConfig(width=16, heads=2, layers=2),
)


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    torch.manual_seed(0)
    folder = tmp_path_factory.mktemp("policy")
    save_pretrained(Policy(CONFIG), folder, "a card")
    return folder


@pytest.fixture(scope="module")
def run(weights):
    return short_run(f"driveinsight:{weights}", DECISIONS, traffic=6, walkers=2)


@pytest.fixture(scope="module")
def found(run):
    env = retrace_env(run, prompt=True)
    return drive_responses(run, run.routes[0], run_agent(run, env), every_s=0.3, env=env)


@pytest.fixture
def folder(run, tmp_path):
    write_run(tmp_path / "run", run)
    return tmp_path / "run"


def test_every_third_decision_is_looked_at_as_it_was_made(run, found):
    assert found.time_s == pytest.approx([0.0, 0.3, 0.6, 0.9])
    assert found.gradient.shape == (4, 9, 2)
    assert found.attention.shape == (4, 2, 2, 9)
    env = retrace_env(run)
    agent = run_agent(run, env)
    for decision in retrace(run, run.routes[0], env=env):
        if decision.number == 6:
            response = responses_at(agent, decision.seen, decision.memory)
    assert np.array_equal(found.gradient[2], response.gradient)
    assert np.array_equal(found.waypoints[2], response.waypoints)


def test_only_what_the_rules_count_is_marked(run, found):
    record = run.routes[0]
    event = EventRecord(kind=EventKind.MIN_SPEED, tick=5, time_s=0.25, x=0.0, y=0.0, z=0.0)
    red = dataclasses.replace(event, kind=EventKind.RED_LIGHT, time_s=0.7)
    record = dataclasses.replace(record, events=(event, red))
    env = retrace_env(run, prompt=True)
    marked = drive_responses(run, record, run_agent(run, env), every_s=0.6, env=env)
    assert marked.events == ((0.7, "red light"),)
    assert marked.drive != found.drive


def test_a_policy_with_sensors_and_a_memory_is_looked_at_as_it_drove_edits_and_all(tmp_path):
    config = PolicyConfig(
        name="sensors",
        grid=GridConfig(cells=24),
        camera=CameraEncoderConfig(rig="rl", width=4, stride=4, channels=4, depth_bins=4),
        lidar=None,
        planner=PlannerConfig(width=16, heads=2, layers=1),
        fusion=FusionConfig(width=4, remembered=4, widths=(4, 4)),
    )
    torch.manual_seed(0)
    save_pretrained(Policy(config), tmp_path, "a card")
    edits = ("drop:bev@t<0.55", "set:speed=3")
    run = short_run(f"driveinsight:{tmp_path}", 8, interventions=edits, traffic=0, walkers=0)
    env = retrace_env(run, prompt=True)
    found = drive_responses(run, run.routes[0], run_agent(run, env), every_s=0.1, env=env)
    bev = found.strength[:, found.groups.index("bev")]
    assert (bev[:6] == 0.0).all()  # cut off behind its tap
    assert (bev[6:] > 0.0).all()
    assert found.agent.endswith("with drop:bev@t<0.55; set:speed=3")


def test_strength_and_share_follow_from_the_gradients(found):
    assert found.strength[1, 2] == pytest.approx(np.hypot(*found.gradient[1, 2]), rel=1e-6)
    assert found.share.sum(axis=1) == pytest.approx(np.ones(4))


def test_what_is_written_is_read_again(found, tmp_path):
    path = responses_file(tmp_path, "0", 0)
    write_responses(path, found)
    again = read_responses(path)
    for field in dataclasses.fields(found):
        one, other = getattr(found, field.name), getattr(again, field.name)
        assert np.array_equal(one, other) if isinstance(one, np.ndarray) else one == other


def test_a_file_of_something_else_is_refused_with_what_to_do(tmp_path):
    path = tmp_path / "route.npz"
    path.write_text("nothing")
    with pytest.raises(ResponseFileError, match="run driveinsight respond again"):
        read_responses(path)
    np.savez(path, about=np.array('{"format": "other"}'))
    with pytest.raises(ResponseFileError, match="again"):
        read_responses(path)


def test_one_route_is_drawn_and_its_moments_are_named(run, folder, capsys):
    route = run.routes[0].route_id
    assert main(["respond", str(folder), "--route", route, "--every", "0.2", "--at", "0.4"]) == 0
    shown = capsys.readouterr().out
    assert "Marked: t = 0.4 s" in shown
    assert "Next: driveinsight respond" in shown
    written = folder / "responses"
    for name in ("gradients", "attention", "heads"):
        with Image.open(written / f"route-{route}-seed-0-{name}.png") as picture:
            assert picture.width > 500
            assert len(picture.convert("RGB").getcolors(maxcolors=10**6)) > 50  # not a blank sheet


def test_all_routes_are_measured_once_and_written_as_tables(folder, capsys, monkeypatch):
    assert main(["respond", str(folder), "--routes", "all", "--every", "0.4"]) == 0
    numbers = json.loads((folder / "responses" / "responses.json").read_text())
    assert set(numbers["by_situation"]["Gx"]) == {*numbers["by_situation"]["share"]}
    assert "Mean response by situation" in (folder / "responses" / "responses.md").read_text()
    assert (folder / "responses" / "situations.png").is_file()

    def never(*_args, **_options):
        raise AssertionError("it was measured already")

    monkeypatch.setattr(measuring, "drive_responses", never)
    assert main(["respond", str(folder), "--routes", "all", "--every", "0.4"]) == 0
    with pytest.raises(AssertionError, match="already"):  # looked at more closely, it is not
        main(["respond", str(folder), "--routes", "all", "--every", "0.2"])


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        ([], "--route ID for one, or --routes all"),
        (["--route", "0", "--routes", "all"], "--route ID for one, or --routes all"),
        (["--route", "nowhere"], "has not driven route nowhere with seed 0; driven: "),
        (["--routes", "nowhere"], "has not driven all of nowhere; driven: "),
        (["--routes", "all", "--every", "0"], "--every must be positive"),
        (["--routes", "all", "--agent", "constant"], "no method explainable()"),
    ],
)
def test_what_cannot_be_done_is_refused_in_a_line(folder, capsys, arguments, hint):
    assert main(["respond", str(folder), *arguments]) == EXIT_USAGE
    shown = " ".join(capsys.readouterr().err.split())
    assert hint in shown


def test_other_weights_are_not_taken_for_those_that_drove(folder, tmp_path, capsys):
    torch.manual_seed(1)
    save_pretrained(Policy(CONFIG), tmp_path / "other", "a card")
    arguments = ["--routes", "all", "--agent", f"driveinsight:{tmp_path / 'other'}"]
    assert main(["respond", str(folder), *arguments]) == EXIT_USAGE
    assert "acts otherwise than recorded" in capsys.readouterr().err


def test_help_teaches_by_example(capsys):
    with pytest.raises(SystemExit):
        main(["respond", "--help"])
    assert "driveinsight respond results/mine --route 3" in capsys.readouterr().out
