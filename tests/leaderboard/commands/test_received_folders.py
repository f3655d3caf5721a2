"""A results folder from anybody: nothing in it runs, steers the terminal, or leads out of it."""

from __future__ import annotations

import ast
import io
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from di_envs.files.json_text import JsonError
from di_envs.files.json_values import from_json
from di_envs.files.plain_text import file_name, one_plain_line, plain
from di_envs.files.shown_text import in_figure, in_markdown
from di_envs.suites import load_suite
from leaderboard.commands.cli import main
from leaderboard.commands.ending import say
from leaderboard.pages.markup import element, json_script
from leaderboard.records.record import AGENT_CRASHED
from leaderboard.records.results import write_run
from leaderboard.responding.response_files import responses_file
from leaderboard.running.displays.work_bar import work_bar
from leaderboard.running.jobs import RunSpec
from leaderboard.running.terminal import Terminal
from leaderboard.studies import StudyError
from leaderboard.studies.driving import StudyPlan, _ours
from leaderboard.studies.record import DrivenRow
from leaderboard.studies.rows import Row
from leaderboard.studies.study_file import _Row
from tests.leaderboard.made_records import route, run_of

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


@pytest.mark.parametrize("command", ["branch", "explain", "respond"])
def test_a_folder_has_nothing_fetched_from_the_hub(command, here, capsys):
    received(agent="driveinsight:hf:me/mine")
    assert main(COMMANDS[command]) == 2
    assert "would fetch the agent 'driveinsight:hf:me/mine'" in capsys.readouterr().err


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


def test_everything_is_printed_on_the_one_console_and_nothing_is_read_as_markup():
    """Rich's own, made anywhere else, would print what it is given."""
    top = Path(__file__).parents[3] / "leaderboard"
    for path in top.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            made = isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Console"
            assert not made, f"{path.name}:{node.lineno}"
            read = isinstance(node, ast.ImportFrom) and node.module == "rich.markup"
            assert not read, f"{path.name}:{node.lineno}"


def test_a_name_in_brackets_is_shown_as_it_is():
    file = io.StringIO()
    console = Terminal(file=file, width=100)
    with work_bar("driving", "s", console=console) as bar:
        bar.add_task("route [/b]", total=1, completed=1)
    console.print("[conceal]a[/b] :skull:")
    assert "route [/b]" in file.getvalue()
    assert "[conceal]a[/b] :skull:" in file.getvalue()


def test_a_name_cannot_say_a_verdict_of_its_own(capsys):
    say("route 1\nThe claim stands", "second")
    assert capsys.readouterr().out == "route 1 The claim stands\nsecond\n"


def test_text_in_markdown_and_figures_begins_nothing():
    assert in_markdown("a|b\n<i>[x](y)\u202e") == "a\\|b, \\<i>\\[x](y)\\u202e"
    assert in_figure("$x$") == r"\$x\$"


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


def test_responses_of_an_evil_route_id_lie_in_their_folder():
    assert responses_file(Path("run"), "/../../../PWN", 0).parent == Path("run")


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
