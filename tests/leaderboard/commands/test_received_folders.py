"""A results folder from anybody: nothing in it runs, steers the terminal, or leads out of it."""

from __future__ import annotations

import ast
import io
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from di_envs.files.json_values import JsonError, from_json
from di_envs.files.plain_text import file_name, one_plain_line, plain
from di_envs.suites import DATA, load_suite
from leaderboard.commands.cli import main
from leaderboard.pages.markup import element, json_script
from leaderboard.records.record import AGENT_CRASHED
from leaderboard.records.results import write_run
from leaderboard.responding.response_files import responses_file
from leaderboard.running.jobs import RunSpec
from leaderboard.running.terminal import Terminal
from leaderboard.studies import StudyError
from leaderboard.studies.driving import StudyPlan, _ours
from leaderboard.studies.record import DrivenRow
from leaderboard.studies.rows import Row
from leaderboard.studies.study_file import _Row
from tests.leaderboard.made_records import route, run_of
from tests.leaderboard.short_drives import short_run

TOY = load_suite("toy")
EVIL = "\x1b[2J\x1b[HThe claim stands\u202e"
MINE = 'import pathlib\npathlib.Path("ran").touch()\n\n\nclass Mine:\n    pass\n'
COMMANDS = {
    "branch": ("branch", "run", "--route", "1", "--at", "0"),
    "explain": ("explain", "run", "--route", "1"),
    "respond": ("respond", "run", "--route", "1"),
    "verify": ("verify", "run", "--observations"),
}


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    Path("mine.py").write_text(MINE)
    Path("package").mkdir()
    Path("package/__init__.py").write_text(MINE)
    Path("package/inner.py").write_text(MINE)
    return tmp_path


def received(**fields):
    record = replace(route("1"), steps=5, interventions=fields.get("interventions", ()))
    write_run(Path("run"), run_of(record, **fields))


@pytest.mark.parametrize("agent", ["mine.py:Mine", "package.inner:Mine", "carla:mine.py"])
@pytest.mark.parametrize("command", ["branch", "explain", "respond"])
def test_an_agent_that_a_folder_names_is_not_run_but_named(command, agent, here, capsys):
    received(agent=agent)
    assert main(COMMANDS[command]) == 2
    said = capsys.readouterr().err
    assert "not ours" in said
    assert "--trust" in said
    assert "--agent" in said
    assert str(here / ("package" if "package" in agent else "mine.py")) in said
    assert not Path("ran").exists()


@pytest.mark.parametrize("command", COMMANDS)
def test_edits_that_a_folder_names_are_not_run_but_named(command, here, capsys):
    received(interventions=("package.inner.Mine:speed",))
    assert main(COMMANDS[command]) == 2
    assert "Mine of the module package.inner" in capsys.readouterr().err
    assert not Path("ran").exists()


def test_a_folder_of_ours_is_asked_nothing(here, capsys):
    received()
    main(COMMANDS["explain"])
    assert "--trust" not in capsys.readouterr().err


def test_a_model_with_pickles_is_asked_for_once(here, monkeypatch, capsys):
    cache = here / "cache"
    cache.mkdir()
    monkeypatch.setenv("DRIVEINSIGHT_CACHE", str(cache))
    for path in (Path("model.zip"), Path("results/model.zip")):
        path.parent.mkdir(exist_ok=True)
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("data", "{}")
    asked = ["drive", "--suite", "toy", "--agent"]

    def complaint(*more):
        assert main([*asked, *more]) == 2
        return capsys.readouterr().err

    first = complaint("sb3:model.zip")
    assert "holds pickles" in first
    assert str(here / "model.zip") in first
    assert "no model of a supported algorithm" in complaint("sb3:results/model.zip")
    assert "no model of a supported algorithm" in complaint("sb3:model.zip", "--trust")
    assert "no model of a supported algorithm" in complaint("sb3:model.zip")


def test_a_status_cannot_clear_the_screen(here, capsys):
    record = replace(route("1"), status=AGENT_CRASHED + EVIL, reason=EVIL)
    write_run(Path("run"), run_of(record, suite="toy" + EVIL, notes=(EVIL,), cpu=EVIL))
    main(["show", "run"])
    main(["verify", "run"])
    shown = capsys.readouterr()
    for text in (shown.out, shown.err):
        assert not {"\x1b", "\u202e"} & set(text)
    assert r"\x1b[2J" in shown.out


def test_what_cannot_be_seen_is_spelled_out_in_terminal_page_and_script():
    assert plain("a\x1bb\u202ec\nd\te\x9b") == "a\\x1bb\\u202ec\nd\te\\x9b"
    assert plain("größer, 大 🚗 №") == "größer, 大 🚗 №"
    assert "\u202e" not in element("p", EVIL, title=EVIL)
    assert "u202e" in json_script("x", {"a": [EVIL]})
    assert "\\\\u202e" in json_script("x", {"a": [EVIL]})
    file = io.StringIO()
    Terminal(file=file, force_terminal=True).print(EVIL, markup=False, highlight=False)
    assert "\x1b[2J" not in file.getvalue()
    assert r"\x1b[2J" in file.getvalue()


def test_exceptions_texts_are_cut():
    assert len(one_plain_line("x" * 10**7)) == 500
    assert one_plain_line("a\n\n b\r\x07") == r"a b \x07"


def test_everything_is_printed_on_the_one_console():
    """Rich's own, made anywhere else, would print what it is given."""
    top = Path(__file__).parents[3] / "leaderboard"
    made = [
        path.name
        for path in top.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Console"
    ]
    assert made == []


@pytest.mark.parametrize(
    "evil", ["/../../../PWN", "..", "../x", "a/b", "a\\b", "con\x00", "", "x" * 5000, ".hidden"]
)
def test_an_id_becomes_a_name_that_leads_nowhere(evil):
    name = file_name(evil)
    assert name
    assert Path(name).name == name
    assert name not in (".", "..")
    assert len(name) < 100
    assert name.isprintable()


def test_plain_ids_keep_their_names_and_others_stay_apart():
    assert file_name("RouteScenario_3.b-1") == "RouteScenario_3.b-1"
    assert len({file_name(name) for name in ("a/b", "a_b", "a:b", "a?b")}) == 4


def test_a_route_id_writes_nothing_outside_its_folder(here):
    evil = "/../../../PWN"
    text = (DATA / "routes" / "toy.xml").read_text()
    Path("evil.xml").write_text(text.replace('<route id="1"', f'<route id="{evil}"'))
    run = short_run("constant", 5, route_id=evil, routes="evil.xml", traffic=0, walkers=0)
    write_run(Path("run"), run)
    before = set(here.parent.rglob("*"))
    assert main(["branch", "run", "--route", evil, "--at", "0.2"]) == 0
    new = set(here.parent.rglob("*")) - before
    assert any(path.name.startswith("branch-_.._.._.._PWN-") for path in new)
    assert all(path.is_relative_to(here / "run") for path in new)
    assert responses_file(Path("run"), evil, 0).parent == Path("run")


def test_a_study_that_is_gone_on_with_runs_no_edit_that_it_names(here, capsys):
    edit = "package.inner.Mine:speed"
    row = DrivenRow(row=Row(name="drop-map", edit=edit), planned=1)
    plan = StudyPlan(kind="ablation", spec=RunSpec(agent="expert"), suite=TOY, rows=())
    with pytest.raises(StudyError, match=r"Mine of the module package\.inner"):
        _ours(here, row, plan)
    assert _ours(here, row, replace(plan, rows=(row.row,))) is row  # the user's own
    assert not Path("ran").exists()


def test_a_row_of_a_study_is_named_as_a_folder_can_be(here):
    row = {"name": "../../out", "edit": "", "component": "", "group": "", "planned": 1}
    row |= {"left_out": "", "wall_s": 0.0, "drives": []}
    with pytest.raises(JsonError, match="expected a name that a folder can have"):
        from_json(_Row, row, "study.json").driven((), "study.json", "rows[1]")
