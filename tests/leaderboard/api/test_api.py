"""The commands as functions: agents out of a cell, results that show themselves, errors."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rich.text import Text

import leaderboard
from agents import load_agent
from agents.base import Requirements
from agents.ownership import code_of_others
from agents.pickled import keep_agent
from di_envs.world.kinds import EventKind
from leaderboard import RequestError, Run, load_run
from leaderboard.api.given_agents import specification_of
from leaderboard.api.requests import in_python
from leaderboard.commands.ending import UsageError
from leaderboard.commands.trusting import check_model
from leaderboard.records.results import write_run
from leaderboard.running.displays.notebook import as_html, in_notebook
from leaderboard.scoring.score import Score
from tests.leaderboard.made_records import event, route, run_of

TOP = Path(__file__).resolve().parents[3]

# What somebody types into a cell; `__main__` has no file then, as in a notebook
CELL = """
import leaderboard
import numpy as np
from agents.base import Requirements

PEDAL = 0.3

class Creep:
    requires = Requirements(observations=("prompt",))

    def __init__(self, pedal=PEDAL):
        self.pedal = pedal

    def start(self, plan, seed):
        return 0

    def act(self, observation, memory):
        return np.array([self.pedal, 0.0, 0.0], np.float32), memory + 1

    def close(self):
        pass

quiet = {"suite": "toy", "traffic": 0, "walkers": 0}
if __name__ == "__main__":
    both = leaderboard.evaluate(Creep, routes=(0, 1), workers=2, **quiet)
    assert both.complete and both.record.isolated, both
    assert both.record.agent.startswith("pickled:results/Creep-"), both.record.agent
    assert "torch" not in both.record.versions, both.record.versions
    print(both)
    again = leaderboard.evaluate(Creep(0.6), routes=0, output="results/fast", **quiet)
    less = leaderboard.compare(both, "results/fast")
    assert [row["same_episode"] for row in less.rows()] == [False]
    same = leaderboard.branch(again, 0, 1.0)
    assert same.same, same
    print(same.title)
"""


class Steady:
    """An agent whose pedal is chosen as it is made."""

    requires = Requirements()

    def __init__(self, throttle: float = 0.2) -> None:
        self.throttle = throttle

    def start(self, plan, seed):
        return None

    def act(self, observation, memory):
        return np.array([self.throttle, 0.0, 0.0], np.float32), memory

    def close(self):
        pass


def test_a_class_typed_into_a_cell_is_scored_with_two_workers_compared_and_branched(tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", CELL],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        timeout=1200,
        env={**os.environ, "PYTHONPATH": str(TOP), "OMP_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr
    run, branched = done.stdout.splitlines()
    assert run.startswith("<Run of pickled:results/Creep-")
    assert run.endswith("; 2 of 2 routes; results/Creep-toy>")
    assert "nothing changed" in branched


def test_a_class_and_an_instance_are_kept_by_value_under_a_name_of_what_they_hold(tmp_path):
    kind, slow, fast = (keep_agent(a, tmp_path) for a in (Steady, Steady(0.3), Steady(0.4)))
    assert len({kind, slow, fast}) == 3
    assert keep_agent(Steady(0.3), tmp_path) == slow
    assert [load_agent(spec).throttle for spec in (kind, slow, fast)] == [0.2, 0.3, 0.4]
    assert load_agent(slow) is not load_agent(slow)
    assert code_of_others(slow) == f"the pickles in {slow.partition(':')[2]}"
    code = f"from agents import load_agent; print(load_agent({fast!r}).throttle)"
    env = {**os.environ, "PYTHONPATH": str(TOP)}  # where nothing has this module
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=env, capture_output=True, text=True
    )
    assert done.stdout == "0.4\n", done.stderr


def test_somebody_elses_pickle_waits_until_it_is_trusted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DRIVEINSIGHT_CACHE", str(tmp_path / "cache"))
    check_model(keep_agent(Steady, tmp_path / "results"), trust=False)
    with pytest.raises(UsageError, match="holds pickles"):
        check_model(keep_agent(Steady, tmp_path / "downloads"), trust=False)


def test_what_is_no_agent_or_cannot_be_handed_over_is_refused_with_what_to_do(tmp_path):
    with pytest.raises(RequestError, match="dict is no agent, it lacks requires, start, act"):
        specification_of({}, tmp_path)
    held = Steady()
    held.file = sys.stdout
    with pytest.raises(RequestError, match="Steady cannot be handed to the process that drives"):
        specification_of(held, tmp_path)
    assert specification_of("expert", tmp_path) == "expert"
    constant = type(load_agent("constant"))
    assert specification_of(constant, tmp_path) == "agents.constant:ConstantAgent"


def test_an_error_says_arguments_not_options():
    told = "choose another --output, pass --resume or --route-ids; `--trust` loads it"
    assert in_python(told) == "choose another output=, pass resume=True or routes=; " + (
        "`trust=True` loads it"
    )
    with pytest.raises(RequestError, match=r"'town05_shrt'; did you mean 'town05_short'"):
        leaderboard.evaluate("expert", "town05_shrt")
    with pytest.raises(RequestError, match="'trafic'; did you mean 'traffic'"):
        leaderboard.evaluate("expert", "toy", trafic=3)
    with pytest.raises(RequestError, match="give the folder"):
        load_run("nowhere")


def made_run(folder: Path) -> Run:
    half = Score(route_completion=100.0, infraction_score=0.5)
    hit = event(EventKind.COLLISION_VEHICLE)
    routes = (route("3"), route("<b>", index=1, score=half, events=(hit, hit)))
    record = dataclasses.replace(run_of(*routes), seeds=(0,))
    write_run(folder, record)
    return load_run(folder)


def test_a_run_shows_itself_in_a_line_a_table_and_a_data_frame(tmp_path):
    run = made_run(tmp_path)
    assert (run.driving_score, run.route_completion, run.infraction_score) == (75.0, 100.0, 0.75)
    assert repr(run) == (
        f"<Run of expert on town05_long: DS 75.0, RC 100.0, IS 0.75; 2 of 2 routes; {tmp_path}>"
    )
    page = run._repr_html_()
    assert "<td>50.00</td>" in page
    assert "&lt;b&gt;" in page
    assert "<b>" not in page
    assert run.rows()[1]["events"] == "vehicle hit x 2"
    pandas = pytest.importorskip("pandas")
    frame = run.to_dataframe()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame["driving_score"]) == [100.0, 50.0]


def test_two_runs_compare_as_values(tmp_path):
    run = made_run(tmp_path / "one")
    better = dataclasses.replace(
        run.record,
        routes=tuple(
            dataclasses.replace(record, score=Score(route_completion=100.0, infraction_score=1.0))
            for record in run.record.routes
        ),
    )
    write_run(tmp_path / "two", better)
    compared = leaderboard.compare(tmp_path / "one", tmp_path / "two")
    assert compared.difference == 25.0
    assert [row["difference"] for row in compared.rows()] == [0.0, 50.0]
    assert "DS +25.0" in repr(compared)


def test_what_is_offered_is_there_and_nothing_else():
    assert {"evaluate", "compare", "report", "explain", "branch", "ablate", "load_run"} <= set(
        leaderboard.__all__
    )
    for name in leaderboard.__all__:
        assert getattr(leaderboard, name).__doc__
    assert set(leaderboard.__all__) <= set(dir(leaderboard))
    with pytest.raises(AttributeError, match=r"it offers .*evaluate"):
        leaderboard.evalute  # noqa: B018


def test_bars_become_html_and_a_shell_is_no_notebook():
    assert not in_notebook()
    shown = as_html(Text.assemble(("driving", "bold"), " & [more]"))
    assert shown.startswith("<pre")
    assert ">driving</span> &amp;" in shown
    assert "more" in shown
