"""The classes of tests: what the lists name is there, and the fast tests reach every folder."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest

from tests import conftest
from tests.test_layout import ALLOWED, TOP, imported, parsed

TESTS = TOP / "tests"
FILES = sorted(TESTS.rglob("test_*.py"))
# Folders that a fast test runs without importing from them or standing beside them
RUN_BY = {
    "leaderboard/envs": "tests/agents/carla/test_carla.py",
    "leaderboard/running/displays": "tests/leaderboard/commands/test_cli.py",
}


@cache
def cases(file: Path) -> frozenset[str]:
    """The tests of a file, by name."""
    functions = (node for node in parsed(file).body if isinstance(node, ast.FunctionDef))
    return frozenset(node.name for node in functions if node.name.startswith("test_"))


@cache
def marked(file: Path) -> frozenset[str]:
    """The tests that a file itself marks as slow or full."""
    body = parsed(file).body
    whole = (node for node in body if isinstance(node, ast.Assign) and is_slow(node.value))
    if any(ast.unparse(node.targets[0]) == "pytestmark" for node in whole):
        return cases(file)
    functions = (node for node in body if isinstance(node, ast.FunctionDef))
    return frozenset(node.name for node in functions if any(map(is_slow, node.decorator_list)))


def is_slow(node: ast.expr) -> bool:
    return any(f"mark.{mark}" in ast.unparse(node) for mark in conftest.LISTED)


def fast(file: Path) -> set[str]:
    """The tests of a file that run with `-m fast`."""
    place = file.relative_to(TOP).as_posix()
    names = frozenset().union(*map(conftest.listed, conftest.LISTED))
    if place in names:
        return set()
    return {name for name in cases(file) - marked(file) if f"{place}::{name}" not in names}


@pytest.mark.parametrize("mark", conftest.LISTED)
def test_a_list_names_tests_that_there_are_once_and_in_order(mark):
    lines = (TESTS / f"{mark}.txt").read_text(encoding="utf-8").splitlines()
    names = [line for line in lines if not line.startswith("#")]
    assert names == sorted(set(names))
    for name in names:
        place, _, case = name.partition("::")
        assert (TOP / place).is_file(), f"tests/{mark}.txt: there is no {place}"
        assert not case or case in cases(TOP / place), f"tests/{mark}.txt: there is no {name}"


def test_no_test_is_listed_twice():
    slow, full = map(conftest.listed, conftest.LISTED)
    assert not slow & full
    whole = {name for name in slow | full if "::" not in name}
    assert not {name for name in (slow | full) - whole if name.partition("::")[0] in whole}


def test_every_folder_of_code_has_a_fast_test():
    """One that stands in the folder's own tests, imports from it, or is said to run it."""
    reached = {Path(folder) for folder, file in RUN_BY.items() if fast(TOP / file)}
    for file in filter(fast, FILES):
        reached |= {file.parent.relative_to(TESTS), *file.parent.relative_to(TESTS).parents}
        for name in imported(parsed(file)):
            reached |= {Path(*name.split(".")), Path(*name.split(".")).parent}
    inits = (init for package in ALLOWED for init in (TOP / package).rglob("__init__.py"))
    assert {init.parent.relative_to(TOP) for init in inits} - reached == set()


def test_what_is_listed_or_marked_is_not_fast(tmp_path, monkeypatch):
    here, layout = TESTS / "test_classes.py", TESTS / "test_layout.py"
    assert "test_no_test_is_listed_twice" in fast(here)
    assert fast(layout) == cases(layout)
    monkeypatch.setattr(conftest, "TESTS", tmp_path)
    (tmp_path / "slow.txt").write_text(
        "# why\ntests/test_classes.py::test_no_test_is_listed_twice\n"
    )
    (tmp_path / "full.txt").write_text("tests/test_layout.py")
    assert cases(here) - fast(here) == {"test_no_test_is_listed_twice"}
    assert fast(layout) == set()


def test_a_file_marks_some_of_its_tests_or_all(tmp_path):
    some, whole = tmp_path / "test_some.py", tmp_path / "test_whole.py"
    text = "def test_a(): ...\n@pytest.mark.slow\ndef test_b(): ...\n"
    some.write_text(text)
    whole.write_text(f"pytestmark = [pytest.mark.full]\n{text}")
    assert marked(some) == {"test_b"}
    assert marked(whole) == {"test_a", "test_b"}
