"""What tests of several folders share: the classes of tests, kernels made beforehand, a folder.

A test is fast unless it says otherwise: `tests/slow.txt` lists what takes more than half a second
with all its cases, `tests/full.txt` what only `just full` runs; both name files, or tests in them.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Generator
from pathlib import Path

import pytest

from tests import kernels_first

TESTS = Path(__file__).resolve().parent
LISTED = ("slow", "full")  # each a mark, and a file of tests that have it
FAST_S = 1.0  # of a processor: beyond it the end of a run names a fast test; twice what is meant
SPENT_S = pytest.StashKey[dict[str, float]]()  # on each fast test, with all its cases


def listed(mark: str) -> frozenset[str]:
    """The files and tests that have a mark by its list, as pytest names them."""
    lines = (TESTS / f"{mark}.txt").read_text(encoding="utf-8").splitlines()
    return frozenset(line for line in lines if line and not line.startswith("#"))


def names_of(item: pytest.Item) -> tuple[str, str]:
    """What a list may call a test by: its file, and itself without its parameters."""
    file = item.nodeid.partition("::")[0]
    return file, item.nodeid.partition("[")[0]


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks what the lists name, and as fast whatever is neither slow nor full."""
    lists = {mark: listed(mark) for mark in LISTED}
    for item in items:
        for mark, names in lists.items():
            if not names.isdisjoint(names_of(item)):
                item.add_marker(mark)
        if not any(item.get_closest_marker(mark) for mark in LISTED):
            item.add_marker("fast")


def pytest_collection_finish(session: pytest.Session) -> None:
    """Compiles kernels before the first test, if any test that was chosen has loaded them."""
    if session.items and not session.config.option.collectonly:
        if "di_envs.numerics.kernels" in sys.modules:
            kernels_first.compile_kernels(session.config)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Notes what fast tests take, by processor time: on a busy machine all take long."""
    before_s = processor_s()
    result = yield
    if item.get_closest_marker("fast"):
        spent_s, name = item.config.stash.setdefault(SPENT_S, {}), names_of(item)[1]
        spent_s[name] = spent_s.get(name, 0.0) + processor_s() - before_s
    return result


def processor_s() -> float:
    """What this process has used of processors, and those that it started and that ended."""
    return sum(os.times()[:4])


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Names fast tests that were not, as lines for the list."""
    spent_s = terminalreporter.config.stash.get(SPENT_S, {})
    late = sorted(name for name, spent in spent_s.items() if spent > FAST_S)
    if late:
        terminalreporter.section(f"marked fast, took over {FAST_S:g} s: lines for tests/slow.txt")
        terminalreporter.write_line("\n".join(late))


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference data beside the checkout; tests that need it skip without."""
    folder = TESTS.parents[1] / "shared"
    if not (folder / "data").is_dir():
        pytest.skip(f"no reference data at {folder / 'data'}")
    return folder
