"""The site: its reference is the code's, its links lead somewhere, its tables are the records'."""

from __future__ import annotations

import dataclasses
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from agents import AGENTS, SCHEMES
from di_envs.config import RouteEnvConfig
from di_envs.edits.world import WORLD_EDITS
from di_envs.rules import RULES
from leaderboard.commands.cli import Command
from wrappers.interventions import EDITS

TOP = Path(__file__).resolve().parent.parent
LONG_S = 1800  # a build, on a busy machine


@pytest.fixture(scope="module")
def site():
    """The modules that make pages, by name."""
    place = str(TOP / "docs" / "scripts" / "site")
    sys.path.insert(0, place)
    try:
        import reference_pages
        import tree_pages
    finally:
        sys.path.remove(place)
    return {"reference": reference_pages, "tree": tree_pages}


@pytest.fixture(scope="module")
def reference(site):
    return site["reference"].reference_pages()


def test_the_reference_has_every_command_with_every_option_of_it(reference):
    for command in get_args(Command):
        kind, described = get_args(command)
        name = described.name
        text, listed = (reference[f"reference/commands/{page}.md"] for page in (name, "index"))
        assert f"[`{name}`]({name}.md)" in listed
        hints = get_type_hints(kind, include_extras=True)
        for field in dataclasses.fields(kind):
            said = getattr(hints[field.name], "__metadata__", ())
            called = next((each.name for each in said if getattr(each, "name", None)), field.name)
            if any("Suppress" in repr(each) for each in said):
                continue  # set by the command itself, and no option
            positional = any("Positional" in repr(each) for each in said)
            option = "positional arguments" if positional else f"--{called.replace('_', '-')}"
            assert option in text, (name, option)


def test_the_reference_has_every_option_edit_rule_and_agent(reference):
    names = {
        "environments": [field.name for field in dataclasses.fields(RouteEnvConfig)],
        "edits": [*(f"{verb}:TARGET" for verb in EDITS), *WORLD_EDITS],
        "rules": list(RULES),
        "agents": [*AGENTS, *(entry.summary.partition(": ")[0] for entry in SCHEMES.values())],
    }
    for page, known in names.items():
        for name in known:
            assert f"`{name}`" in reference[f"reference/{page}.md"], (page, name)


def test_every_file_that_a_page_links_becomes_a_page_whatever_its_kind(site, monkeypatch):
    monkeypatch.setattr(site["tree"], "repository", lambda: "")
    pages = site["tree"].tree_pages()
    assert "````text\nabsl-py==" in pages["source/constraints.txt.md"]
    assert "````python\n" in pages["source/examples/language_model_agent.py.md"]


def test_the_reference_says_the_numbers_that_the_conventions_say(reference):
    text = reference["reference/observations.md"]
    assert (
        "| `stop_signs` | (4, 4) | `float32` | -100, -100, -3.1416, 0 | 100, 100, 3.1416, 1 |"
        in text
    )
    assert "| `lidar` | (5600, 4) |" in text
    assert "| `collision_walker` | x 0.50 | x 0.50 | + 1.00 |  |" in reference["reference/rules.md"]


def test_what_the_reference_puts_in_is_there(site):
    for _, places in site["reference"].API.values():
        for place in places:
            path = TOP / place.replace(".", "/")
            inner = (TOP / place.rpartition(".")[0].replace(".", "/")).with_suffix(".py")
            assert path.with_suffix(".py").is_file() or path.is_dir() or inner.is_file(), place


@pytest.mark.parametrize(
    ("text", "source", "there"),
    [
        ("[a](docs/agents.md#paths)", "README.md", "[a](agents.md#paths)"),
        ("[a](../README.md)", "docs/results.md", "[a](index.md)"),
        ("[a](../benchmarks/README.md)", "docs/results.md", "[a](benchmarks.md)"),
        ("[a](benchmarks/)", "README.md", "[a](benchmarks.md)"),
        ("[a](../recipes/tiny.toml)", "docs/training.md", "[a](source/recipes/tiny.toml.md)"),
        ("[a](https://example.org/x.md)", "README.md", "[a](https://example.org/x.md)"),
        ("[a](#start)", "README.md", "[a](#start)"),
        ("```\n[a](docs/agents.md)\n```", "README.md", "```\n[a](docs/agents.md)\n```"),
    ],
)
def test_links_between_files_lead_to_pages_on_the_site(site, text, source, there, monkeypatch):
    monkeypatch.setattr(site["tree"], "repository", lambda: "")
    assert site["tree"].on_site(text, source) == there


def test_links_to_code_lead_to_the_repository_where_one_is_named(site, monkeypatch):
    monkeypatch.setattr(site["tree"], "repository", lambda: "https://example.org/us/it")
    found = site["tree"].on_site("[a](../recipes/tiny.toml), [b](../examples)", "docs/training.md")
    assert found == (
        "[a](https://example.org/us/it/blob/HEAD/recipes/tiny.toml), "
        "[b](https://example.org/us/it/tree/HEAD/examples)"
    )


def test_the_package_page_links_the_repository_where_one_is_named():
    page = runpy.run_path(str(TOP / "setup.py"))["package_page"]
    text = "![a](docs/images/a.png) [b](docs/b.md#c) [d](https://example.org) [e](#f)"
    assert page(text, "https://example.org/us/it") == (
        "![a](https://example.org/us/it/raw/HEAD/docs/images/a.png) "
        "[b](https://example.org/us/it/blob/HEAD/docs/b.md#c) [d](https://example.org) [e](#f)"
    )
    assert page(text, "") == text


def test_how_to_cite_is_what_the_citation_file_says(site):
    text = site["tree"].cite_page((TOP / "CITATION.cff").read_text(encoding="utf-8"))
    assert "title = {Exploring the Causality of End-to-End Autonomous Driving}" in text
    assert "author = {Li, Jiankun and Li, Hao and Liu, Jiangjiang" in text


def test_the_tables_of_the_leaderboard_are_those_of_its_records():
    board = runpy.run_path(str(TOP / "docs" / "scripts" / "leaderboard_page.py"))
    records = board["read_records"]()
    assert records
    page = (TOP / "docs" / "leaderboard.md").read_text(encoding="utf-8")
    assert page == board["with_tables"](page, board["tables"](records)), (
        "python docs/scripts/leaderboard_page.py draws them anew"
    )


def test_a_row_of_the_leaderboard_can_be_redone_on_paper():
    board = runpy.run_path(str(TOP / "docs" / "scripts" / "leaderboard_page.py"))
    record = {
        **{"agent": "mine", "agent_version": "mine 1", "track": "PROMPT", "seeds": [0]},
        "infractions": {"red_light": 3},
        "columns": list(board["COLUMNS"]),
        "routes": [["0", 0, 70.0, 100.0, 0.7, 100.0, 1.0], ["1", 0, 49.0, 100.0, 0.49, 80.0, 0.5]],
    }
    assert board["line"]("records/toy/mine.json", record) == (
        "| `mine` (mine 1) | PROMPT | 59.5 | 100.0 | 0.59 | 90.0 | 2.00 | 1 | "
        "[mine.json](records/toy/mine.json) |"
    )


@pytest.mark.parametrize(("text", "said"), [(None, "there is no"), ("{", "is not whole JSON")])
def test_what_is_no_run_is_refused_by_the_leaderboard_in_a_line(tmp_path, capsys, text, said):
    board = runpy.run_path(str(TOP / "docs" / "scripts" / "leaderboard_page.py"))
    if text is not None:
        (tmp_path / "driveinsight.json").write_text(text, encoding="utf-8")
    with pytest.raises(SystemExit):
        board["main"](["--add", str(tmp_path)])
    assert said in capsys.readouterr().err


@pytest.mark.full
def test_the_site_is_built_without_warnings_and_asks_nobody_else(tmp_path):
    pytest.importorskip("mkdocs", reason="needs the extra docs")
    place = os.pathsep.join(filter(None, (str(TOP), os.environ.get("PYTHONPATH"))))
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
        timeout=LONG_S,
        cwd=TOP,
        env={**os.environ, "PYTHONPATH": place, "NO_MKDOCS_2_WARNING": "1"},
    )
    assert done.returncode == 0, done.stderr
    assert "remove:actor" in (tmp_path / "search" / "search_index.json").read_text("utf-8")
    pages = sorted(tmp_path.rglob("*.html"))
    assert len(pages) > 60
    fetched = re.compile(r'<(?:script|img|iframe)[^>]* src="?http|<link[^>]*stylesheet[^>]*http')
    for page in pages:
        found = fetched.search(page.read_text("utf-8"))
        assert found is None, (page, found)
