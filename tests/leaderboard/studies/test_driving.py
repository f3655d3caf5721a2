"""Studies that are driven: the null row, going on, more seeds, and what is refused."""

from __future__ import annotations

import dataclasses
import io
import json
import shutil
from pathlib import Path

import pytest
from rich.console import Console

from di_envs.suites import load_suite
from leaderboard.commands.cli import main
from leaderboard.records.results import read_run
from leaderboard.replaying.verify import verify_run
from leaderboard.running.jobs import RunSpec
from leaderboard.studies import StudyError
from leaderboard.studies.driving import StudyPlan, drive_study
from leaderboard.studies.more_seeds import recover_run
from leaderboard.studies.rows import choose_rows
from leaderboard.studies.study_file import read_study, write_study
from tests.leaderboard.studies.drives_here import FOLLOWER, HereEngine

ROWS = ("zero-routing", "drop-routing", "zero-speed", "drop-bev", "zero-odometry")
OPTIONS = {"suite": "toy", "traffic": 2, "walkers": 1, "route_ids": ("0", "1")}
UNSTEADY = """
from pathlib import Path
from agents.base import Requirements, make_control
class Unsteady:
    requires = Requirements()
    def start(self, plan, seed):
        with open(Path(__file__).with_suffix(".count"), "a+") as file:
            file.write(".")  # from run to run, each in a process of its own
            return file.tell()
    def act(self, observation, memory): return make_control(0.3 + 0.1 * (memory % 5), 0, 0), memory
    def close(self): pass
"""


def plan(rows=ROWS, agent=FOLLOWER, **changes):
    spec = RunSpec(agent=agent, options={**OPTIONS, **changes})
    return StudyPlan(kind="ablation", spec=spec, suite=load_suite("toy"), rows=choose_rows(rows))


def driven(folder, seeds=1, engine=None, study_plan=None):
    return drive_study(
        study_plan or plan(),
        seeds,
        folder=folder,
        engine=engine or HereEngine(),
        console=Console(file=io.StringIO()),
        keep=lambda study: write_study(folder, study),
    )


def timeless(study):
    """The study without what the clock on the wall says."""
    rows = tuple(
        dataclasses.replace(
            each, drives=tuple(dataclasses.replace(drive, wall_s=0.0) for drive in each.drives)
        )
        for each in study.rows
    )
    return dataclasses.replace(study, rows=rows)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A study of one seed that nothing disturbed."""
    folder = tmp_path_factory.mktemp("study")
    study, interrupted = driven(folder)
    assert not interrupted
    return folder, study


@pytest.fixture
def copy(whole, tmp_path):
    return Path(shutil.copytree(whole[0], tmp_path / "copy"))


def test_each_row_is_an_ordinary_run_that_can_be_verified(whole):
    folder, study = whole
    assert study.complete
    for name in ("baseline", "null", "zero-routing", "drop-routing", "zero-speed"):
        run = read_run(folder / "rows" / name)
        assert run.complete
        verdict = verify_run(run, folder / "rows" / name, observations=True)
        assert verdict.stands
    assert read_run(folder / "rows" / "zero-speed").interventions == ("zero:speed",)


def test_the_null_row_is_the_baseline_and_an_edit_is_not(whole):
    _, study = whole
    episodes = {
        name: [drive.episode for drive in study.row(name).drives]
        for name in ("baseline", "null", "zero-routing", "zero-speed")
    }
    assert episodes["null"] == episodes["baseline"]
    assert all(a != b for a, b in zip(episodes["zero-speed"], episodes["baseline"], strict=True))
    assert len(set(episodes["baseline"])) == 2


def test_what_the_agent_is_not_shown_is_left_out_with_the_reason(whole):
    _, study = whole
    reasons = {driven.row.name: driven.left_out for driven in study.left_out}
    assert set(reasons) == {"drop-bev", "zero-odometry"}
    assert "has no taps" in reasons["drop-bev"]
    assert reasons["zero-odometry"] == "the agent sees no odometry"


def test_a_finished_study_is_left_as_it_is(whole, copy):
    engine = HereEngine()
    study, _ = driven(copy, engine=engine)
    assert engine.driven == 0
    assert study == whole[1]
    assert read_study(copy) == whole[1]


def test_stopped_by_ctrl_c_it_goes_on_to_the_same_record(whole, tmp_path):
    engine = HereEngine(stop_after=4)
    study, interrupted = driven(tmp_path / "stopped", engine=engine)
    assert interrupted
    assert not study.complete
    assert [len(each.drives) for each in study.rows[:3]] == [2, 2, 0]
    again, interrupted = driven(tmp_path / "stopped")
    assert not interrupted
    assert timeless(again) == timeless(whole[1])


@pytest.mark.full
def test_more_seeds_add_to_what_is_there_and_change_nothing_of_it(whole, copy, tmp_path):
    engine = HereEngine()
    more, _ = driven(copy, seeds=2, engine=engine)
    assert engine.driven == 5 * 2  # the second seed of five rows
    at_once, _ = driven(tmp_path / "at once", seeds=2)
    assert timeless(more) == timeless(at_once)
    assert read_run(copy / "rows" / "null").seeds == (0, 1)
    assert all(drive in more.baseline.drives for drive in whole[1].baseline.drives)
    assert verify_run(read_run(copy / "rows" / "null"), copy / "rows" / "null").stands
    with pytest.raises(StudyError, match="has 2 seeds; more can be added, none taken away"):
        driven(copy, seeds=1)


def test_more_rows_add_to_what_is_there(copy, tmp_path):
    engine = HereEngine()
    study, _ = driven(copy, engine=engine, study_plan=plan(rows=("zero-map",)))
    assert engine.driven == 2
    assert [each.row.name for each in study.rows][-1] == "zero-map"
    assert len(study.compared) == 4


def test_a_row_caught_between_two_renames_is_found_again(whole, copy):
    rows = copy / "rows"
    (rows / "zero-speed").rename(rows / ".zero-speed.old")
    shutil.copytree(rows / "null", rows / ".zero-speed.new")
    recover_run(rows / "zero-speed")
    assert sorted(path.name for path in rows.iterdir()) == sorted(
        ["baseline", "null", "zero-routing", "drop-routing", "zero-speed"]
    )
    assert read_run(rows / "zero-speed") == read_run(whole[0] / "rows" / "zero-speed")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"agent": "constant"}, "agent was .*, is constant"),
        ({"traffic": 3}, "options 'traffic' was 2, is 3"),
        ({"route_ids": ("0",)}, "options 'route_ids'"),
    ],
)
def test_another_study_is_refused_and_left_alone(copy, change, message):
    before = (copy / "study.json").read_bytes()
    with pytest.raises(StudyError, match=message):
        driven(copy, study_plan=plan(rows=("zero-map",), **change))
    assert (copy / "study.json").read_bytes() == before


def test_a_study_of_another_version_is_refused(copy):
    content = json.loads((copy / "study.json").read_text())
    content["versions"]["numpy"] = "1.0"
    (copy / "study.json").write_text(json.dumps(content))
    with pytest.raises(StudyError, match=r"versions 'numpy' was 1\.0"):
        driven(copy)


def test_an_agent_that_drives_otherwise_each_time_has_no_study(tmp_path):
    (tmp_path / "unsteady.py").write_text(UNSTEADY)
    agent = f"{tmp_path / 'unsteady.py'}:Unsteady"
    with pytest.raises(StudyError, match="does not drive the same way twice"):
        driven(tmp_path / "study", study_plan=plan(rows=("zero-map",), agent=agent))


def test_where_no_row_can_be_driven_it_says_why(tmp_path):
    with pytest.raises(StudyError, match=r"nothing to study .* sees no odometry"):
        driven(tmp_path / "study", study_plan=plan(rows=("odometry",)))


@pytest.mark.slow
def test_the_command_drives_shows_and_names_the_next_step(tmp_path, capsys):
    words = ["ablate", "--agent", FOLLOWER, "--suite", "toy", "--traffic", "0", "--walkers", "0"]
    words += ["--route-ids", "0", "--rows", "zero-routing", "--output", str(tmp_path)]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "exactly 0" in out
    assert "driveinsight verify" in out
    assert (tmp_path / "study.png").is_file()
    assert main(["ablate", "--show", str(tmp_path)]) == 0
    assert "zero:routing" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--suite", "toy"], "say whom to study"),
        (["--agent", "constant", "--suite", "toy", "--seeds", "0"], "--seeds must be"),
        (["--agent", "constant", "--suite", "toy", "--rows", "drop-rooting"], "drop-routing"),
        (["--show", "nowhere"], "there is no nowhere/study.json"),
    ],
)
def test_wrong_words_are_answered_with_what_to_do(capsys, words, message):
    assert main(["ablate", *words]) == 2
    assert message in capsys.readouterr().err
