"""What a suite is made of, by content, and its files from any folder."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from di_envs.suite_files import content_of, found_beside, from_anywhere, suite_of
from di_envs.suites import DATA, load_suite


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(DATA / "toy.xodr", "map.xodr")
    shutil.copy(DATA / "routes" / "toy.xml", "routes.xml")
    Path("triggers").mkdir()
    shutil.copy(DATA / "scenarios" / "toy.json", "triggers/toy.json")
    return tmp_path


def test_the_same_files_under_other_names_are_the_same_content(here):
    own = suite_of({"town": "map.xodr", "routes": "routes.xml", "scenarios": "triggers"})
    shipped = content_of(suite_of({"suite": "toy", "scenarios": "toy"}))
    found = content_of(own)
    for name in ("town", "routes", "scenarios", "signals"):
        assert found[name] == shipped[name]
    assert found["suite"] != shipped["suite"]  # another name, and no version


@pytest.mark.parametrize(
    ("name", "file"),
    [("town", "map.xodr"), ("routes", "routes.xml"), ("scenarios", "triggers/toy.json")],
)
def test_one_byte_in_one_file_is_another_content_of_that_alone(here, name, file):
    suite = suite_of({"town": "map.xodr", "routes": "routes.xml", "scenarios": "triggers"})
    before = content_of(suite)
    with open(file, "a", encoding="utf-8") as appended:
        appended.write(" ")
    after = content_of(suite)
    assert {key for key in before if before[key] != after[key]} == {name}


def test_another_version_or_signals_are_another_content():
    toy = load_suite("toy")
    before = content_of(toy)
    for name, change in (("suite", {"version": 99}), ("signals", {"signals": "none"})):
        after = content_of(replace(toy, **change))
        assert {key for key in before if before[key] != after[key]} == {name}
    assert content_of(replace(toy, description="In other words.")) == before


def test_files_are_found_from_anywhere_and_names_stay(here, monkeypatch):
    given = {"suite": "toy", "town": "map.xodr", "scenarios": "triggers, toy", "traffic": 3}
    placed = from_anywhere(given)
    assert placed == {
        "suite": "toy",
        "town": str(here / "map.xodr"),
        "scenarios": f"{here / 'triggers'},toy",
        "traffic": 3,
    }
    assert from_anywhere({"town": "town05", "signals": "town05", "scenarios": "none"}) == {
        "town": "town05",
        "signals": "town05",
        "scenarios": "none",
    }
    sent = here / "sent"
    sent.mkdir()
    shutil.move("map.xodr", sent)
    assert found_beside(placed, sent)["town"] == str(sent / "map.xodr")
    assert found_beside(placed, sent)["scenarios"] == placed["scenarios"]
