"""The measures of the prompt-editing experiments, on drives whose answer is known."""

from __future__ import annotations

import dataclasses
import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rich.console import Console

from agents.driveinsight.config import config_named
from agents.driveinsight.model import Policy
from agents.driveinsight.weights import save_pretrained
from di_envs.town.plan import RoutePlan
from leaderboard.commands.cli import main
from leaderboard.pages.prompt_pictures import write_prompt_picture
from leaderboard.records.results import write_run
from leaderboard.replaying.replay import replay_env
from leaderboard.statistics.claim_verdict import ClaimVerdict
from leaderboard.studies import StudyError
from leaderboard.studies.approaches import (
    GREEN_SHOWN,
    RED_SHOWN,
    Approach,
    approaches,
    held_at_green,
    judge_lights,
    ran_red,
)
from leaderboard.studies.experiments import EXPERIMENTS, choose_experiments
from leaderboard.studies.failures import has_failed, judge_bev, judge_map
from leaderboard.studies.lateral import judge_route, lateral_offsets
from leaderboard.studies.prompt_editing import finding_sentence
from leaderboard.studies.record import DrivenRow
from leaderboard.studies.route_place import RoutePlace, offsets
from leaderboard.studies.speed_sweep import DOSES_MPS, judge_speed, path_length, sweep
from tests.leaderboard.made_records import route, run_of
from tests.leaderboard.short_drives import short_run
from tests.leaderboard.studies.drives_here import FOLLOWER, drive, row, study

HASHES = [f"route {number}" for number in range(12)]
MANY = [f"route {number}" for number in range(30)]


def straight(length_m=100):
    """A route due east, a point a metre."""
    along = np.arange(length_m + 1.0)
    points = np.stack([along, 0 * along, 0 * along, 0 * along], axis=1)
    return RoutePlan(
        route_id="7",
        town="none",
        keypoints=points[[0, -1], :3],
        points=points,
        option=np.full(len(along), 4, np.int8),
        lane=np.zeros(len(along), np.int32),
        lane_m=along,
        route_m=along,
        targets=np.array([0, length_m], np.int32),
    )


def trace(lateral_m, length_m=100):
    """Rows of an ego that drives 5 m/s, so far right of that route (y is south: to the right)."""
    return tuple((t / 2, 2.5 * t, lateral_m, 0.0, 0.0, 5.0) for t in range(int(length_m / 2.5)))


def test_an_ego_south_of_a_route_due_east_is_right_of_it():
    place = RoutePlace(straight())
    place.move(10.2, 1.5, 0.0)
    assert (place.route_m, place.lateral_m) == (10.0, pytest.approx(1.5))
    along, beside = offsets(trace(-2.0), straight())
    assert along[-1] > 90.0
    assert beside == pytest.approx(-2.0)


def test_a_route_that_crosses_itself_is_followed_in_order():
    """Out 40 m east and back on the same line: at the same place, another part of the route."""
    plan = straight(80)
    points = plan.points.copy()
    points[41:, 0] = 40.0 - np.arange(1, 41)
    points[41:, 3] = math.pi
    plan = dataclasses.replace(plan, points=points)
    place = RoutePlace(plan)
    for x in range(0, 41, 2):
        place.move(float(x), 0.0, 0.0)
    assert place.route_m == 40.0
    for x in range(38, -1, -2):
        place.move(float(x), 0.0, math.pi)
    assert place.route_m == 80.0


def moved(share_by_edit):
    """Offsets measured on twelve routes, where each edit takes the ego along by a share."""
    measured = {}
    for what, share in share_by_edit.items():
        for asked in (-2.0, 2.0):
            measured[f"shift:{what},lateral={asked:g}"] = [
                (name, 0, name, asked * (share + 0.02 * (place % 2)))
                for place, name in enumerate(HASHES)
            ]
    return measured


def test_the_offset_of_an_edited_drive_is_measured_against_the_unedited_one():
    before = run_of(route(trace=trace(0.5)))
    after = run_of(route(trace=trace(2.0)))
    ((route_id, seed, route_hash, metres),) = lateral_offsets(before, after, {"7": straight()})
    assert (route_id, seed, route_hash) == ("7", 0, "aa")
    assert metres == pytest.approx(1.5)


def test_a_drive_that_ended_at_once_says_nothing():
    short = run_of(route(trace=trace(0.0, 12.0)))
    assert lateral_offsets(short, short, {"7": straight()}) == []


@pytest.mark.parametrize(
    ("shares", "verdict"),
    [
        ((0.1, 0.0, 0.9), ClaimVerdict.HOLDS),
        ((0.9, 0.0, 0.9), ClaimVerdict.DOES_NOT_HOLD),  # routing alone is enough
        ((0.1, 0.0, 0.2), ClaimVerdict.DOES_NOT_HOLD),  # both together are not
        ((0.495, 0.0, 0.9), ClaimVerdict.UNDECIDED),
    ],
)
def test_the_route_experiment_asks_who_takes_the_ego_along(shares, verdict, tmp_path):
    edits = dict(zip(("routing", "target_point", "routing+target_point"), shares, strict=True))
    judgement = judge_route(moved(edits))
    assert judgement.verdict == verdict
    assert judgement.numbers["sides"]["routing"]["2"] == pytest.approx(shares[0] + 0.01)
    assert write_prompt_picture(tmp_path / "route.png", judgement)


def test_without_all_three_rows_there_is_no_judgement():
    assert judge_route(moved({"routing": 0.5})) is None


def seen(colour, *, held=False, crossed=False, count=12):
    return [
        Approach(route_id=name, seed=0, route_hash=name, colour=colour, held=held, crossed=crossed)
        for name in HASHES[:count]
    ]


def test_only_lights_of_the_colour_in_question_count_that_the_ego_decided_about():
    some = [*seen("green", held=True, count=2), *seen("red", crossed=True, count=3)]
    some += [*seen("green", count=4), *seen("red", count=5)]  # of the last ones nothing came
    assert [share for share, _ in held_at_green(some)] == [1.0, 1.0]
    assert [share for share, _ in ran_red(some)] == [1.0, 1.0, 1.0]


def test_the_lights_experiment_counts_shares_of_approaches(tmp_path):
    led = {
        "": [*seen("green", crossed=True), *seen("red", held=True)],
        RED_SHOWN: seen("green", held=True),
        GREEN_SHOWN: seen("red", crossed=True),
    }
    judgement = judge_lights(led)
    assert judgement.verdict == ClaimVerdict.HOLDS
    assert "the ego stands before 100 % of 12" in judgement.sentence
    assert "(unedited: 0 % of 12)" in judgement.sentence
    assert finding_sentence(judgement).startswith("The paper's finding holds here: green lights")
    stubborn = judge_lights({**led, RED_SHOWN: seen("green", crossed=True)})
    assert stubborn.verdict == ClaimVerdict.DOES_NOT_HOLD
    assert judge_lights({"": []}) is None
    three = {
        RED_SHOWN: seen("green", held=True, count=3),
        GREEN_SHOWN: seen("red", crossed=True, count=3),
    }
    assert judge_lights(three).verdict == ClaimVerdict.UNDECIDED  # three of three may be chance
    assert write_prompt_picture(tmp_path / "lights.png", judgement)
    with Image.open(tmp_path / "lights.png") as image:
        assert image.width > 500


def edited_study(experiment, events, names=MANY):
    """Thirty routes; under each edit of the experiment these events happen."""
    routes = [drive(name, route_hash=name) for name in names]
    rows = [
        DrivenRow(
            row=each,
            planned=len(names),
            drives=tuple(dataclasses.replace(one, episode="x", events=events) for one in routes),
        )
        for each in EXPERIMENTS[experiment].rows
    ]
    base = (row("baseline", *routes), row("null", *routes))
    return study(*base, *rows, kind="prompt editing")


def test_failures_are_counted_once_a_drive():
    assert has_failed(drive(events={"outside_lanes": 3}), "wrong lane or off road") == 1.0
    assert has_failed(drive(events={"outside_lanes": 3}), "collision") == 0.0
    assert has_failed(drive(events={"timeout": 1}), "any of these") == 1.0


def test_the_map_experiment_asks_whether_more_drives_fail(tmp_path):
    calm = judge_map(edited_study("map", {}))
    assert calm.verdict == ClaimVerdict.HOLDS
    assert judge_map(edited_study("map", {"red_light": 1})).verdict == ClaimVerdict.HOLDS
    few = judge_map(edited_study("map", {}, HASHES))
    assert few.verdict == ClaimVerdict.UNDECIDED  # on 12 routes chance can hide one drive in three
    lost = judge_map(edited_study("map", {"route_deviation": 1}))
    assert lost.verdict == ClaimVerdict.DOES_NOT_HOLD
    assert "wrong lane or off road +100 %" in lost.sentence
    assert judge_map(edited_study("bev", {})) is None
    assert write_prompt_picture(tmp_path / "map.png", lost)


def test_the_bev_experiment_is_the_other_way_round():
    assert judge_bev(edited_study("bev", {"collision_static": 1})).verdict == ClaimVerdict.HOLDS
    assert judge_bev(edited_study("bev", {})).verdict == ClaimVerdict.DOES_NOT_HOLD


def asked(slope):
    """Answers on twelve drives: a path of 4 m and so many more for each m/s that is told."""
    return [
        {
            "route_hash": name,
            "moments": 10,
            "unedited_m": 24.0,
            "speed": [4.0 + slope * dose + 0.1 * (place % 2) for dose in DOSES_MPS],
            "speed+speed_history": [4.0 + 2 * slope * dose for dose in DOSES_MPS],
        }
        for place, name in enumerate(HASHES)
    ]


def test_the_speed_experiment_compares_paths_at_0_and_10_metres_per_second(tmp_path):
    judgement = judge_speed(asked(2.0))
    assert judgement.verdict == ClaimVerdict.HOLDS
    assert judgement.numbers["gains"]["speed"]["mean"] == pytest.approx(20.0)
    assert judgement.numbers["curves"]["speed"]["mean"][0] == pytest.approx(4.05)
    assert judge_speed(asked(0.1)).verdict == ClaimVerdict.DOES_NOT_HOLD  # 1 m of 24
    assert judge_speed([]) is None
    assert write_prompt_picture(tmp_path / "speed.png", judgement)


def test_a_path_is_measured_from_the_ego():
    assert path_length(np.array([[3.0, 4.0], [3.0, 6.0]])) == 7.0


def test_experiments_are_chosen_by_name():
    assert [each.name for each in choose_experiments()] == list(EXPERIMENTS)
    with pytest.raises(StudyError, match="did you mean 'lights'"):
        choose_experiments(["light"])


def test_an_agent_that_knows_no_lights_drives_over_the_red_ones_that_it_meets():
    """The follower never stops: each light is one approach, over while it shows what it showed."""
    run = short_run(FOLLOWER, 300, suite="town05_tiny", route_id="97", traffic=0, walkers=0)
    env = replay_env(run)
    found = approaches(run, run.routes[0], env)
    assert found
    assert not any(each.held for each in found)
    reds = sum(each.colour == "red" and each.crossed for each in found)
    events = sum(event.kind.name == "RED_LIGHT" for event in run.routes[0].events)
    assert reds <= events <= reds + sum(not each.crossed for each in found)


def test_a_light_that_was_yellow_as_the_ego_drove_over_it_is_a_red_one_that_it_met():
    """No infraction, as yellow is free; yet whoever is shown green there is led by it."""
    run = short_run("expert-redrunner", 120, route_id="2", seed=1, traffic=2, walkers=1)
    assert not any(event.kind.name == "RED_LIGHT" for event in run.routes[0].events)
    env = replay_env(run)
    found = [(each.colour, each.crossed) for each in approaches(run, run.routes[0], env)]
    assert found == [("green", False), ("red", True)]
    env.close()


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    folder = tmp_path_factory.mktemp("policy")
    save_pretrained(Policy(config_named("driveinsight-told")), folder, "untrained")
    return folder


def test_a_policy_is_asked_at_moments_of_a_drive_and_not_again(policy, tmp_path):
    run = short_run(f"driveinsight:{policy}", 60, traffic=0, walkers=0)
    write_run(tmp_path / "rows" / "baseline", run)
    (answer,) = sweep(tmp_path, 1, Console(quiet=True))
    assert answer["moments"] == math.ceil(run.routes[0].steps / 25)
    assert len(answer["speed"]) == len(DOSES_MPS)
    assert len({round(length, 3) for length in answer["speed"]}) > 1
    (path,) = (tmp_path / "speed").iterdir()
    before = path.stat().st_mtime_ns
    assert sweep(tmp_path, 1, Console(quiet=True)) == [answer]
    assert path.stat().st_mtime_ns == before
    path.write_text(json.dumps({**answer, "episode": "another"}))
    assert sweep(tmp_path, 1, Console(quiet=True)) == [answer]


def test_who_gives_no_waypoints_cannot_be_asked(tmp_path):
    run = short_run(FOLLOWER, 10, traffic=0, walkers=0)
    write_run(tmp_path / "rows" / "baseline", run)
    with pytest.raises(StudyError, match=r"has no method explainable\(\)"):
        sweep(tmp_path, 1, Console(quiet=True))


@pytest.mark.slow
def test_the_command_drives_measures_shows_and_says_what_there_is_nothing_on(tmp_path, capsys):
    words = ["edit", "--agent", FOLLOWER, "--suite", "toy", "--traffic", "0", "--walkers", "0"]
    words += ["--route-ids", "0", "--experiments", "speed", "lights", "--output", str(tmp_path)]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "Nothing on the given speed set from 0 to 15 m/s: RouteFollower cannot be" in out
    assert "recolour:lights=red" in out
    shown = Path(shutil.copytree(tmp_path, tmp_path / "copy"))
    assert main(["edit", "--show", str(shown)]) == 0
    assert "recolour:lights=red" in capsys.readouterr().out
    assert main(["ablate", "--show", str(shown)]) == 2
    assert "another kind, prompt editing" in capsys.readouterr().err
