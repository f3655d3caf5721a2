"""A results folder from a stranger: no word of it steers a reader, no name leads out, no code runs.

The commands are given it as a user gives it to them.
"""

from __future__ import annotations

import base64
import json
import pickle
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from agents import AgentSpecError, load_agent
from di_envs.suites import DATA
from leaderboard.commands.cli import main
from leaderboard.pages import study_files
from leaderboard.records.record import AGENT_CRASHED
from leaderboard.records.results import write_run
from leaderboard.responding.response_files import read_responses, write_responses
from leaderboard.studies.ablation import work_out
from leaderboard.studies.study_file import read_study, write_study
from leaderboard.tables.response_tables import tables_of, write_tables
from tests.hostile.formats import Ran
from tests.leaderboard.made_records import route, run_of
from tests.leaderboard.responding.made_drives import made_drive
from tests.leaderboard.short_drives import short_run
from tests.leaderboard.studies.drives_here import drive, row, study

# Clears the screen; sets a window's title; turns a line around; hides letters; ends a line early
STEERING = "\x1b[2J\x1b[H \x1b]0;owned\x07 \u202e \u2066 \U000e0041 \x9b2J"
# rich's markup, which hides or would not be read; Matplotlib's formulas; a verdict of their own
MARKUP = "[conceal]hidden[/b] :skull: $\\frac$ <b>bold</b>"
EVIL = f"words{STEERING}{MARKUP}\r\nThe claim stands: DS 100.00"
LEADING_OUT = "/../../../PWN"
CODE = 'import pathlib\npathlib.Path("PWN").touch()\n\n\nclass Mine:\n    pass\n'
NAMED = [
    *("theirs.py:Mine", ".theirs.py:Mine", "theirs:Mine", "agents.theirs:Mine"),
    *("carla:theirs.py", "sb3:theirs.zip"),
]
LOOKS = {
    "branch": ["branch", "run", "--route", "1", "--at", "0"],
    "explain": ["explain", "run", "--route", "1"],
    "respond": ["respond", "run", "--route", "1"],
}
READS = [
    ["show", "run"],
    ["verify", "run"],
    ["report", "run"],
    ["score", "run", "--rules", "carla-2.0"],
    ["compare", "run", "run"],
]


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a stranger's code in it."""
    inside = tmp_path / "in"
    inside.mkdir()
    monkeypatch.chdir(inside)
    monkeypatch.syspath_prepend(inside)
    for name in ("theirs.py", ".theirs.py"):
        Path(name).write_text(CODE)
    a_model_with_code(Path("theirs.zip"), inside / "PWN")
    return inside


def a_model_with_code(path: Path, canary: Path) -> None:
    """A model as Stable-Baselines3 saves it; whoever loads it runs code."""
    code = base64.b64encode(pickle.dumps(Ran(canary))).decode()
    data = {"policy_class": {"__module__": "x", ":serialized:": code}, "gae_lambda": 1.0}
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data", json.dumps(data))


def received(**fields: object) -> None:
    """A run in the folder `run`, of which a field says something else."""
    record = replace(route("1"), steps=5, interventions=fields.get("interventions", ()))
    write_run(Path("run"), run_of(record, **fields))


def plain_to_read(text: str) -> bool:
    return all(sign.isprintable() or sign in "\n\t" for sign in text)


def test_no_word_of_a_run_steers_terminal_or_page(here, capsys):
    run = short_run("constant", 5, traffic=0, walkers=0)
    record = replace(run.routes[0], status=AGENT_CRASHED, reason=EVIL)
    fields = dict.fromkeys(("agent", "suite", "town", "cpu", "agent_version"), EVIL)
    write_run(Path("run"), replace(run, routes=(record,), notes=(EVIL,), **fields))
    said = {}
    for command in READS:
        assert main(command) == (1 if command[0] == "verify" else 0)
        shown = capsys.readouterr()
        assert plain_to_read(shown.out)
        assert plain_to_read(shown.err)
        said[command[0]] = shown.out
    assert all("words" in said[name] for name in ("show", "verify", "score", "compare"))
    assert "[conceal]hidden[/b] :skull:" in said["verify"]
    lines = said["verify"].splitlines()
    assert not any(line.startswith("The claim stands") for line in lines)
    page = Path("run/report.html").read_bytes().decode()
    assert "words" in page
    assert plain_to_read(page)
    assert "<b>bold" not in page


def test_no_word_of_a_study_or_of_responses_steers_who_reads_the_markdown(here):
    rows = [row(name, drive("0"), drive("1")) for name in ("baseline", "null", "drop-map")]
    write_study(here, study(*rows, agent=EVIL, suite=EVIL))
    table, picture = study_files.write_ablation(here, work_out(read_study(here)))
    write_responses(here / "one.npz", replace(made_drive([[1.0, 0.0]] * 3), agent=EVIL))
    drives = [read_responses(here / "one.npz")]
    text, _ = write_tables(here, drives, tables_of(drives))
    assert picture.stat().st_size > 0  # its formula is drawn as it is written
    for path in (table, text):
        written = path.read_bytes().decode()
        assert "words" in written
        assert plain_to_read(written)
        assert "<b>" not in written.replace("\\<b>", "")
        assert not any(line.startswith("The claim stands") for line in written.splitlines())


@pytest.mark.parametrize("agent", NAMED)
@pytest.mark.parametrize("command", LOOKS)
def test_an_agent_that_a_folder_names_waits_for_trust(command, agent, here, capsys):
    received(agent=agent)
    assert main(LOOKS[command]) == 2
    assert "--trust" in capsys.readouterr().err
    assert not Path("PWN").exists()


@pytest.mark.parametrize("command", [*LOOKS.values(), ["verify", "run", "--observations"]])
def test_edits_that_a_folder_names_wait_for_trust(command, here, capsys):
    received(interventions=("theirs.Mine:speed",))
    assert main(command) == 2
    assert "Mine of the module theirs" in capsys.readouterr().err
    assert not Path("PWN").exists()


@pytest.mark.parametrize("command", READS, ids=" ".join)
def test_what_only_reads_a_folder_runs_nothing_of_it(command, here):
    received(agent="theirs.py:Mine", interventions=("theirs.Mine:speed",))
    main(command)
    assert not Path("PWN").exists()


@pytest.mark.parametrize("command", ["drive", "evaluate"])
def test_a_model_with_pickles_waits_for_trust(command, here, capsys):
    words = [command, "--suite", "toy", "--agent", "sb3:theirs.zip"]
    assert main(words) == 2
    said = capsys.readouterr().err
    assert "holds pickles" in said
    assert str(here / "theirs.zip") in said
    assert not Path("PWN").exists()


def test_such_a_model_would_have_run_its_code(here):
    pytest.importorskip("stable_baselines3")
    with pytest.raises(AgentSpecError):
        load_agent("sb3:theirs.zip")
    assert Path("PWN").exists()


@pytest.mark.parametrize("command", ["branch", "explain"])
def test_a_route_id_writes_nothing_outside_its_folder(command, here):
    text = (DATA / "routes" / "toy.xml").read_text()
    Path("evil.xml").write_text(text.replace('<route id="1"', f'<route id="{LEADING_OUT}"'))
    options = {"route_id": LEADING_OUT, "routes": "evil.xml", "traffic": 0, "walkers": 0}
    write_run(Path("run"), short_run("constant", 5, **options))
    before = set(here.parent.rglob("*"))
    assert main([command, "run", "--route", LEADING_OUT, "--at", "0.2"]) == 0
    new = set(here.parent.rglob("*")) - before
    assert any(path.name.startswith(f"{command}-_.._.._.._PWN-") for path in new)
    assert all(path.is_relative_to(here / "run") for path in new)


def test_a_link_in_a_folder_leads_nobody_out_of_it(here, capsys):
    received()
    Path("outside").mkdir()
    Path("run/responses").symlink_to(here / "outside")
    assert main(LOOKS["respond"]) == 2
    assert "name one with --output" in capsys.readouterr().err
    assert not any(Path("outside").iterdir())
